"""Walls that move: every grain engine must take the grains along as the motion says."""

import math
from dataclasses import replace

import numpy as np
import pytest
from engine_scenes import (
    LIMIT_S,
    G,
    R,
    along,
    assert_all_accounted,
    box,
    lattice,
    level,
    line_of,
    on_every_engine,
    setup_of,
    table,
    upright,
)

from fidelity.engine import Engine, Packing, Physics, WallMotion


@on_every_engine
def test_a_moving_box_takes_its_grains_along_and_drops_them_over_the_edge(engine: Engine) -> None:
    # The box slides over a table that ends at x = 0.1 m; there all its grains fall out.
    times = np.linspace(0.0, 0.2, 41)
    slide = along((1.0, 0.0, 0.0), times, 0.1 * (1 - np.cos(np.pi * times / times[-1])))
    setup = replace(
        setup_of(
            line_of(5),
            lattice(24, across=4, z=1.3 * R),
            box(16 * R, 12 * R, floor=False, motion=slide),
            table(-0.1, 0.1),
            duration=1.0,
        ),
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
    push = along((1.0, 0.0, 0.0), np.array([0.0, 1.0]), np.array([0.0, speed]))
    pusher = box(0.2, 0.05, floor=False, motion=push)
    pusher = replace(pusher, vertices=pusher.vertices + np.array([start, 0.0, 0.0]))
    setup = setup_of(line_of(5), packing, pusher, table(-0.2, 0.5), duration=0.2)
    movement = engine.move(setup, time_limit_s=LIMIT_S)
    wall = start - 0.1 + speed * movement.end_time
    ahead = float(movement.positions[0, 0]) - wall
    # Never behind the wall, and thrown ahead by less than an elastic bounce would.
    assert 3.0 * R < ahead < 3.6 * R + speed * movement.end_time
    assert abs(movement.positions[0, 1]) < 0.02


@on_every_engine
def test_grains_flow_out_below_a_lifted_box(engine: Engine) -> None:
    times = np.array([0.0, 0.1, 0.4])
    lift = along((0.0, 0.0, 1.0), times, np.array([0.0, 0.0, 0.12]))
    straight = lattice(24, across=4, z=1.3 * R)
    # Rods that lie exactly on top of each other would balance.
    aside = np.random.default_rng(1).uniform(-0.1 * R, 0.1 * R, (24, 1)) * [0.0, 1.0, 0.0]
    setup = replace(
        setup_of(
            line_of(5),
            Packing(straight.positions + aside, straight.orientations),
            box(16 * R, 12 * R, floor=False, motion=lift),
            table(-0.2, 0.2),
            duration=0.6,
        ),
        snapshot_times=np.array([0.1]),
    )
    movement = engine.move(setup, time_limit_s=LIMIT_S)
    assert movement.status == "finished", movement.why
    footprint = np.array([8 * R, 6 * R])
    (standing,) = movement.snapshots["snapshot_positions"]
    assert (np.abs(standing[:, :2]) < footprint).all()
    # The rim is far above the grains now, and the heap that it held has spread.
    assert movement.positions[:, 2].max() < 0.06
    assert movement.positions[:, 2].mean() < 0.7 * standing[:, 2].mean()
    assert (movement.positions[:, 2] > 0.8 * R).all()


@on_every_engine
def test_a_lifted_floor_takes_its_grain_along(engine: Engine) -> None:
    times = np.array([0.0, 0.3, 0.5])
    climb = np.outer([0.0, 0.06, 0.06], [0.0, 0.0, 1.0]) + np.outer([0, 0.03, 0.03], [0, 1.0, 0])
    floor = replace(table(-0.1, 0.1), motion=WallMotion(times, climb))
    packing = Packing(np.array([[0.0, 0.0, R]]), level(1))
    movement = engine.move(setup_of(line_of(5), packing, floor, duration=0.9), time_limit_s=LIMIT_S)
    assert movement.status == "finished", movement.why
    assert movement.positions[0, 2] == pytest.approx(0.06 + R, abs=0.05 * R)
    # The floor starts and stops with a jerk, so the grain slips or rolls at both ends.
    assert 0.0 < movement.positions[0, 1] < 0.06


@on_every_engine
def test_a_grain_slides_down_a_tilting_plate_once_that_is_steeper_than_friction(
    engine: Engine,
) -> None:
    rate, mu = 1.0, 0.3  # [rad/s]
    times = np.array([0.0, 1.0])
    tilt = WallMotion(times, np.zeros((2, 3)), rate * times, axis=(0.0, 1.0, 0.0))
    plate = replace(table(-0.2, 0.2), motion=tilt)
    setup = replace(
        setup_of(line_of(5), Packing(np.array([[0.0, -0.05, R]]), level(1)), plate, duration=0.55),
        physics=Physics(damping=0.0),  # YADE's numerical damping acts on friction too
        exit_z=-1.0,
        snapshot_times=np.array([0.25, 0.5]),
    )
    movement = engine.move(setup, time_limit_s=LIMIT_S)
    assert movement.status == "finished", movement.why
    x, y, z = movement.snapshots["snapshot_positions"][:, 0].T
    when = movement.snapshots["snapshot_times"]
    along_plate = x * np.cos(rate * when) - z * np.sin(rate * when)
    height = x * np.sin(rate * when) + z * np.cos(rate * when)
    assert height == pytest.approx([R, R], rel=0.01)
    assert along_plate[0] == pytest.approx(0.0, abs=0.02 * R)
    assert along_plate[1] == pytest.approx(slid(rate, mu, when[1]), rel=0.04)
    assert y == pytest.approx([-0.05, -0.05], abs=1e-4)


def slid(rate: float, mu: float, until: float) -> float:
    """Way of a block on a plate that tilts with `rate` [rad/s] from level, by Euler's method."""
    h = 1e-5
    way = speed = 0.0
    for t in np.arange(0.0, until, h):
        press = G * math.cos(rate * t) - 2 * rate * speed  # the plate falls away below it
        pull = G * math.sin(rate * t) + rate**2 * way
        speed = max(0.0, speed + h * (pull - mu * press))
        way += h * speed
    return way


@on_every_engine
def test_a_turning_table_drags_a_sphere_the_way_it_moves_there(engine: Engine) -> None:
    # The triangle below the sphere has its middle elsewhere, where it moves in another direction.
    times, pivot = np.array([0.0, 1.0]), np.array([0.05, 0.0, 0.0])
    turn = WallMotion(times, np.zeros((2, 3)), 5.0 * times, (0.0, 0.0, 1.0), (0.05, 0.0, 0.0))
    plate = replace(table(-0.3, 0.5), motion=turn)
    place = np.array([[0.15, 0.0, R]])
    setup = replace(
        setup_of(line_of(1), Packing(place, level(1)), plate, duration=0.05),
        physics=Physics(damping=0.0),
    )
    movement = engine.move(setup, time_limit_s=LIMIT_S)
    direction = np.cross([0.0, 0.0, 1.0], place[0] - pivot)
    direction /= np.linalg.norm(direction)
    gained = movement.velocities[0] @ direction
    # It slips all the time; meanwhile the table's direction turns by 0.25.
    assert gained == pytest.approx(0.3 * G * movement.end_time, rel=0.05)
    assert abs(movement.velocities[0, 0]) < 0.1 * gained
