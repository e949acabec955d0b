"""Small scenes for YADE: a box, grains of five spheres in it or falling."""

import math
from dataclasses import replace

import numpy as np

from fidelity.engine import Grain, Material, Packing, Physics, Setup, Wall, WallMotion
from mfopt.arrays import Array

G = 9.81  # [m/s2]
R = 2e-3  # [m] radius of the spheres
DENSITY = 1400.0  # [kg/m3]
HALF_BOX = 0.03  # [m]
LIMIT_S = 300.0  # far above what any of these runs needs
MATERIAL = Material(young_modulus=1e6, poisson_ratio=0.3, friction_angle=0.4, density=DENSITY)
SMOOTH = replace(MATERIAL, friction_angle=0.0)


def rice(axis: int = 0, transverse: float = 1.0) -> Grain:
    """Five spheres along `axis`, with the mass and the inertia of a cylinder as long."""
    offsets = np.zeros((5, 3))
    offsets[:, axis] = 1.25 * R * np.arange(-2, 3)
    length = 7 * R
    mass = DENSITY * math.pi * R**2 * length
    inertia = np.full(3, transverse * mass * (length**2 / 12 + R**2 / 4))
    inertia[axis] = 0.5 * mass * R**2
    return Grain(offsets, np.full(5, R), mass, inertia)


def box(half: float = HALF_BOX, height: float = 0.3, *, motion: WallMotion | None = None) -> Wall:
    """A square box without a lid, its floor at z = 0."""
    corners = ((-half, -half), (half, -half), (half, half), (-half, half))
    vertices = np.array([(x, y, z) for z in (0.0, height) for x, y in corners])
    sides = [
        t
        for i in range(4)
        for t in ((i, (i + 1) % 4, 4 + (i + 1) % 4), (i, 4 + (i + 1) % 4, 4 + i))
    ]
    return Wall("box", vertices, np.array([(0, 1, 2), (0, 2, 3), *sides]), MATERIAL, motion)


def along_x(times: Array, way: Array) -> WallMotion:
    return WallMotion(times, np.outer(way, [1.0, 0.0, 0.0]))


def lattice(n: int, seed: int = 0) -> Packing:
    """Grains in layers in the box, nearly along x, without overlap."""
    rng = np.random.default_rng(seed)
    k, row = np.divmod(np.arange(n), 3 * 10)
    j, i = np.divmod(row, 3)
    positions = np.array([(i - 1) * 8 * R, (j - 4.5) * 2.6 * R, 2 * R + k * 2.6 * R]).T
    orientations = np.array([1.0, 0.0, 0.0, 0.0]) + rng.normal(0.0, 0.02, (n, 4))
    orientations /= np.linalg.norm(orientations, axis=1)[:, None]
    return Packing(positions + rng.uniform(-0.1 * R, 0.1 * R, (n, 3)), orientations)


def single(x: float, y: float, z: float, turn: Array | None = None) -> Packing:
    unit = np.array([1.0, 0.0, 0.0, 0.0]) if turn is None else turn
    return Packing(np.array([[x, y, z]]), unit[None])


BOXED = Setup(
    grain=rice(),
    packing=lattice(40),
    grain_material=MATERIAL,
    walls=(box(),),
    physics=Physics(),
    duration=0.15,
    exit_z=-1.0,
)
FALL = replace(BOXED, packing=single(0.0, 0.0, 0.4), walls=(), exit_z=0.0, duration=1.0)
