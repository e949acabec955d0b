"""The engines under test, and the smallest scenes that show what an engine does."""

import math
import shutil

import numpy as np
import pytest

from fidelity.engine import Grain, Material, Movement, Packing, Physics, Setup, Wall, WallMotion
from fidelity.engines.bullet.engine import BulletEngine
from fidelity.engines.numba import NumbaEngine
from fidelity.engines.yade.engine import YadeEngine
from fidelity.grains.grain import line_grain
from mfopt.arrays import Array

R = 4e-3  # [m] sphere radius
G = 9.81  # [m/s2]
DENSITY = 1400.0  # [kg/m3]
LIMIT_S = 120.0  # wall clock, far above what any run here takes

ENGINES = [
    pytest.param(NumbaEngine(), id="numba"),
    pytest.param(BulletEngine(), id="bullet"),
    pytest.param(
        YadeEngine(),
        id="yade",
        marks=[
            pytest.mark.yade,
            pytest.mark.skipif(shutil.which("yade") is None, reason="YADE is not installed"),
        ],
    ),
]
on_every_engine = pytest.mark.parametrize("engine", ENGINES)
# Engines whose contacts are springs, and which tell what the grains exert on each wall.
on_springs = pytest.mark.parametrize("engine", [e for e in ENGINES if e.id != "bullet"])

GRAIN_MATERIAL = Material(1e6, 0.3, math.atan(0.5), DENSITY)
WALL_MATERIAL = Material(1e7, 0.3, math.atan(0.3), DENSITY)


def line_of(spheres: int) -> Grain:
    """Spheres in a line, 1.25 radii apart."""
    return line_grain((2 + 1.25 * (spheres - 1)) * R, 2 * R, spheres, DENSITY)


def lattice(grains: int, *, across: int, z: float) -> Packing:
    """Lying grains in layers of two by `across`, slightly turned so that they tumble."""
    k = np.arange(grains)
    x, y, layer = k % 2, (k // 2) % across, k // (2 * across)
    positions = np.column_stack(
        [7.6 * R * (x - 0.5), 2.6 * R * (y - (across - 1) / 2), z + 2.6 * R * layer]
    )
    half = np.random.default_rng(1).uniform(-0.02, 0.02, grains)
    zeros = np.zeros(grains)
    return Packing(positions, np.column_stack([np.cos(half), zeros, zeros, np.sin(half)]))


def box(length: float, width: float, *, floor: bool, motion: WallMotion | None = None) -> Wall:
    """An open box of 0.2 m height around x = y = 0, its lower rim at z = 0."""
    x, y, h = length / 2, width / 2, 0.2
    rim = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
    sides = [[a, b, b + 4] for a, b in ((0, 1), (1, 2), (2, 3), (3, 0))]
    sides += [[a, b + 4, a + 4] for a, b in ((0, 1), (1, 2), (2, 3), (3, 0))]
    ground = [[0, 1, 2], [0, 2, 3]] if floor else []
    corners = np.vstack([rim, rim + np.array([0.0, 0.0, h])])
    return Wall("box", corners, np.array(ground + sides), WALL_MATERIAL, motion)


def table(x_from: float, x_to: float) -> Wall:
    """A level plate at z = 0."""
    y = 0.2
    corners = np.array([[x_from, -y, 0.0], [x_to, -y, 0.0], [x_to, y, 0.0], [x_from, y, 0.0]])
    return Wall("table", corners, np.array([[0, 1, 2], [0, 2, 3]]), WALL_MATERIAL)


def along(direction: tuple[float, float, float], times: Array, way: Array) -> WallMotion:
    return WallMotion(times, np.outer(way, direction))


def setup_of(grain: Grain, packing: Packing, *walls: Wall, duration: float) -> Setup:
    return Setup(
        grain=grain,
        packing=packing,
        grain_material=GRAIN_MATERIAL,
        walls=walls,
        physics=Physics(),
        duration=duration,
        exit_z=-0.1,
    )


def pile_in_box(duration: float) -> Setup:
    packing = lattice(40, across=4, z=1.3 * R)
    return setup_of(line_of(5), packing, box(16 * R, 12 * R, floor=True), duration=duration)


def upright(angle: float) -> Array:
    """Quaternion of a turn about y."""
    return np.array([[math.cos(angle / 2), 0.0, math.sin(angle / 2), 0.0]])


def level(grains: int) -> Array:
    """Quaternions of grains that lie along x."""
    return np.tile([1.0, 0.0, 0.0, 0.0], (grains, 1))


def turned(quaternion: Array, vectors: Array) -> Array:
    """Vectors (..., 3) of the grain's frame in space."""
    w, v = quaternion[0], quaternion[1:]
    twist = 2 * np.cross(v, vectors)
    return np.asarray(vectors + w * twist + np.cross(v, twist))


def assert_all_accounted(setup: Setup, movement: Movement) -> None:
    n = setup.packing.positions.shape[0]
    assert movement.exit_times.shape == (n,)
    assert movement.positions.shape == movement.velocities.shape == (n, 3)
    assert movement.angular_velocities.shape == (n, 3)
    assert movement.orientations.shape == (n, 4)
    assert np.isfinite(movement.positions).all()
    left = np.isfinite(movement.exit_times)
    assert (movement.positions[~left, 2] >= setup.exit_z).all()
    assert (np.abs(movement.positions[left, 2] - setup.exit_z) < 0.01).all()
    assert (movement.exit_times[left] <= movement.end_time).all()
