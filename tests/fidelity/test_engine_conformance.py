"""What every grain engine must do, on the smallest scenes that show it."""

import math
import shutil
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fidelity.bullet import BulletEngine
from fidelity.engine import (
    Engine,
    Grain,
    Material,
    Movement,
    Packing,
    Physics,
    Setup,
    Wall,
    WallMotion,
)
from fidelity.grain import line_grain
from fidelity.yade import YadeEngine
from mfopt.arrays import Array

R = 4e-3  # [m] sphere radius
G = 9.81  # [m/s2]
DENSITY = 1400.0  # [kg/m3]
LIMIT_S = 120.0  # wall clock, far above what any run here takes

ENGINES = [
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


def box(length: float, width: float, *, floor: bool, moves: bool = False) -> Wall:
    """An open box of 0.2 m height around x = y = 0, its lower rim at z = 0."""
    x, y, h = length / 2, width / 2, 0.2
    rim = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
    sides = [[a, b, b + 4] for a, b in ((0, 1), (1, 2), (2, 3), (3, 0))]
    sides += [[a, b + 4, a + 4] for a, b in ((0, 1), (1, 2), (2, 3), (3, 0))]
    ground = [[0, 1, 2], [0, 2, 3]] if floor else []
    return Wall(
        "box", np.vstack([rim, rim + np.array([0.0, 0.0, h])]), np.array(ground + sides), moves
    )


def table(x_from: float, x_to: float) -> Wall:
    """A level plate at z = 0."""
    y = 0.2
    corners = np.array([[x_from, -y, 0.0], [x_to, -y, 0.0], [x_to, y, 0.0], [x_from, y, 0.0]])
    return Wall("table", corners, np.array([[0, 1, 2], [0, 2, 3]]))


def setup_of(grain: Grain, packing: Packing, *walls: Wall, duration: float) -> Setup:
    return Setup(
        grain=grain,
        packing=packing,
        grain_material=GRAIN_MATERIAL,
        wall_material=WALL_MATERIAL,
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


def assert_all_accounted(setup: Setup, movement: Movement) -> None:
    n = setup.packing.positions.shape[0]
    assert movement.exit_times.shape == (n,)
    assert movement.positions.shape == movement.velocities.shape == (n, 3)
    assert movement.orientations.shape == (n, 4)
    assert np.isfinite(movement.positions).all()
    left = np.isfinite(movement.exit_times)
    assert (movement.positions[~left, 2] >= setup.exit_z).all()
    assert (np.abs(movement.positions[left, 2] - setup.exit_z) < 0.01).all()
    assert (movement.exit_times[left] <= movement.end_time).all()


@on_every_engine
@pytest.mark.parametrize(("spheres", "drop"), [(1, 0.1), (5, 0.6)])
def test_a_grain_without_contact_falls_as_in_vacuum(
    engine: Engine, spheres: int, drop: float
) -> None:
    packing = Packing(np.array([[0.0, 0.0, drop - 0.1]]), upright(0.7))
    movement = engine.move(setup_of(line_of(spheres), packing, duration=1.0), time_limit_s=LIMIT_S)
    assert movement.status == "finished", movement.why
    assert movement.exit_times[0] == pytest.approx(math.sqrt(2 * drop / G), rel=0.005)
    # Nothing turns it: the orientation that it left with is that of the start.
    assert abs(float(movement.orientations[0] @ packing.orientations[0])) == pytest.approx(1.0)


@on_every_engine
def test_a_grain_that_comes_with_the_cup_flies_a_parabola(engine: Engine) -> None:
    packing = Packing(np.array([[0.0, 0.0, 0.0]]), upright(0.0))
    setup = setup_of(line_of(5), packing, table(5.0, 6.0), duration=0.2)
    movement = engine.move(replace(setup, start_velocity=1.5), time_limit_s=LIMIT_S)
    fall = math.sqrt(2 * 0.1 / G)
    assert movement.exit_times[0] == pytest.approx(fall, rel=5e-3)
    assert movement.positions[0, 0] == pytest.approx(1.5 * fall, abs=1.5 * 1.1e-3)  # next check
    assert movement.velocities[0, 0] == pytest.approx(1.5, rel=1e-9)


@on_every_engine
def test_damping_of_gravity_slows_the_fall_by_its_share(engine: Engine) -> None:
    packing = Packing(np.array([[0.0, 0.0, 0.2]]), upright(0.0))
    setup = setup_of(line_of(5), packing, duration=1.0)
    slowed = replace(setup, physics=Physics(damping=0.2, damp_gravity=True))
    movement = engine.move(slowed, time_limit_s=LIMIT_S)
    assert movement.exit_times[0] == pytest.approx(math.sqrt(2 * 0.3 / (0.8 * G)), rel=0.005)


@on_every_engine
def test_a_sphere_slides_down_an_incline_by_the_friction_of_its_pair(engine: Engine) -> None:
    # A sphere's friction spins it: on a slope steeper than 3.5 mu it slips and accelerates with
    # g (sin a - mu cos a); mu belongs to the smaller of the two friction angles, 0.3.
    slope, mu, time = math.radians(60), 0.3, 0.25
    down = np.array([math.cos(slope), 0.0, -math.sin(slope)])
    normal = np.array([math.sin(slope), 0.0, math.cos(slope)])
    side = np.array([0.0, 0.2, 0.0])
    plane = Wall(
        "slope",
        np.array([-side, 1.2 * down - side, 1.2 * down + side, side]) - 0.2 * down,
        np.array([[0, 1, 2], [0, 2, 3]]),
    )
    packing = Packing(R * normal[None], upright(0.0))
    # Undamped: YADE's numerical damping acts on the contact's force too.
    setup = replace(
        setup_of(line_of(1), packing, plane, duration=time),
        exit_z=-2.0,
        physics=Physics(damping=0.0),
    )
    movement = engine.move(setup, time_limit_s=LIMIT_S)
    travelled = float((movement.positions[0] - packing.positions[0]) @ down)
    expected = G * (math.sin(slope) - mu * math.cos(slope)) * movement.end_time**2 / 2
    assert travelled == pytest.approx(expected, rel=0.02)


@on_every_engine
def test_grains_settle_in_a_box_and_none_is_lost(engine: Engine) -> None:
    setup = replace(pile_in_box(2.0), settle=True)
    movement = engine.move(setup, time_limit_s=LIMIT_S)
    assert movement.status == "finished", movement.why
    assert_all_accounted(setup, movement)
    assert movement.end_time < setup.duration
    assert np.isnan(movement.exit_times).all()
    x, y, z = np.abs(movement.positions).T
    assert x.max() < 8 * R
    assert y.max() < 6 * R
    assert z.min() > 0.5 * R
    assert z.max() < setup.packing.positions[:, 2].max()
    # At rest: less energy than lifts each grain by a tenth of its radius.
    energy = 0.5 * setup.grain.mass * np.sum(movement.velocities**2)
    assert energy < 0.1 * setup.grain.mass * G * R * 40


@cache
def falling_pile(engine: Engine) -> tuple[Setup, Movement]:
    """40 grains fallen into a box, not yet at rest."""
    setup = replace(pile_in_box(0.15), snapshot_times=np.array([0.05, 0.1]))
    return setup, engine.move(setup, time_limit_s=LIMIT_S)


@on_every_engine
def test_energy_comes_from_nowhere_but_height(engine: Engine) -> None:
    setup, movement = falling_pile(engine)
    assert movement.status == "finished", movement.why
    weight = setup.grain.mass * G
    drop = float(np.sum(setup.packing.positions[:, 2] - movement.positions[:, 2]))
    left = 0.5 * setup.grain.mass * float(np.sum(movement.velocities**2))
    assert drop > 0
    assert left < weight * drop
    # No more than if all had fallen to the floor at once.
    assert 0 < movement.max_kinetic_energy < weight * float(setup.packing.positions[:, 2].sum())
    assert movement.max_overlap < 0.5


@on_every_engine
def test_the_same_setup_repeats_bit_for_bit(engine: Engine) -> None:
    setup, one = falling_pile(engine)
    two = engine.move(setup, time_limit_s=LIMIT_S)
    assert one.snapshots["snapshot_positions"].shape == (2, 40, 3)
    for name in ("exit_times", "positions", "orientations", "velocities"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
    for name, values in one.snapshots.items():
        np.testing.assert_array_equal(values, two.snapshots[name])
    for name in ("steps", "sphere_steps", "max_overlap", "max_kinetic_energy"):
        assert getattr(one, name) == getattr(two, name)


@on_every_engine
def test_a_moving_box_takes_its_grains_along_and_drops_them_over_the_edge(engine: Engine) -> None:
    # The box slides over a table that ends at x = 0.1 m; there all its grains fall out.
    times = np.linspace(0.0, 0.2, 41)
    way = 0.1 * (1 - np.cos(np.pi * times / times[-1]))
    setup = replace(
        setup_of(
            line_of(5),
            lattice(24, across=4, z=1.3 * R),
            box(16 * R, 12 * R, floor=False, moves=True),
            table(-0.1, 0.1),
            duration=1.0,
        ),
        motion=WallMotion(times, way),
        idle_after=0.5,
        idle_above_z=0.0,
        snapshot_times=np.array([0.1]),
    )
    movement = engine.move(setup, time_limit_s=LIMIT_S)
    assert movement.status == "finished", movement.why
    assert_all_accounted(setup, movement)
    assert np.isfinite(movement.exit_times).all()
    assert movement.exit_times.min() > 0.1
    # Halfway the box stands at 0.1 m, and every grain is inside.
    (halfway,) = movement.snapshots["snapshot_positions"]
    inside = np.abs(halfway[:, :2] - [0.1, 0.0]) < [8 * R, 6 * R]
    assert inside.all()
    # Spheres that have left are not moved any more.
    assert movement.sphere_steps < 24 * 5 * movement.steps


@on_every_engine
def test_a_wall_pushes_a_grain_at_its_own_speed_or_faster(engine: Engine) -> None:
    speed, start = 0.5, 0.05
    packing = Packing(np.array([[start - 0.1 + 3.6 * R, 0.0, 1.0 * R]]), upright(0.0))
    pusher = box(0.2, 0.05, floor=False, moves=True)
    pusher = replace(pusher, vertices=pusher.vertices + np.array([start, 0.0, 0.0]))
    setup = replace(
        setup_of(line_of(5), packing, pusher, table(-0.2, 0.5), duration=0.2),
        motion=WallMotion(np.array([0.0, 1.0]), np.array([0.0, speed])),
    )
    movement = engine.move(setup, time_limit_s=LIMIT_S)
    wall = start - 0.1 + speed * movement.end_time
    ahead = float(movement.positions[0, 0]) - wall
    # Never behind the wall, and thrown ahead by less than an elastic bounce would.
    assert 3.0 * R < ahead < 3.6 * R + speed * movement.end_time
    assert abs(movement.positions[0, 1]) < 0.02


@on_every_engine
def test_grains_that_cannot_pass_any_more_end_the_run(engine: Engine) -> None:
    setup = replace(pile_in_box(1.0), idle_after=0.05, idle_above_z=0.0)
    movement = engine.move(setup, time_limit_s=LIMIT_S)
    assert movement.status == "finished", movement.why
    assert movement.end_time == pytest.approx(0.05, abs=0.005)


@on_every_engine
def test_the_time_limit_ends_a_run(engine: Engine) -> None:
    movement = engine.move(pile_in_box(3600.0), time_limit_s=2.0)
    assert movement.status == "timed_out"
    assert movement.why is not None
    assert "2 s" in movement.why
    assert movement.positions.shape == (40, 3)


@on_every_engine
def test_overlapping_grains_that_burst_are_crashed(engine: Engine) -> None:
    # All grains in one place: no result can come of that.
    packing = lattice(30, across=4, z=1.3 * R)
    squeezed = Packing(packing.positions * 0.05 + [0, 0, 2 * R], packing.orientations)
    setup = setup_of(line_of(5), squeezed, box(16 * R, 12 * R, floor=True), duration=0.2)
    movement = engine.move(setup, time_limit_s=LIMIT_S)
    assert movement.status == "crashed"
    assert movement.why


@on_every_engine
def test_engines_name_themselves_and_their_version(engine: Engine) -> None:
    assert engine.name
    assert engine.cost_factor > 0
    assert any(c.isdigit() for c in engine.version())
