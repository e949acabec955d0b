"""Walls that move: what they carry, throw and work, and where grains leave."""

import math

import numpy as np
import pytest

from benchmarks.engine.small_scenes import (
    LEVEL,
    G,
    R,
    Start,
    moved,
    plane,
    scene,
    sled,
    spheres_in_line,
    still,
    wall_stiffness,
)
from fidelity.engine import Grain, WallMotion
from mfopt.arrays import Array

MU = 0.4


def resting(grain: Grain, contacts: int) -> Start:
    """A grain on a level plane, pressed in by its weight."""
    return Start((0.0, 0.0, R - grain.mass * G / (contacts * wall_stiffness())))


def shaken(frequency: float, amplitude: float, duration: float) -> WallMotion:
    """A wall that swings up and down, starting without a jerk."""
    times = np.linspace(0.0, duration, 4001)
    way = amplitude * (1 - np.cos(2 * math.pi * frequency * times))
    return WallMotion(times, np.outer(way, [0.0, 0.0, 1.0]))


def test_a_lifted_plate_carries_its_load_and_works_for_it() -> None:
    grain, speed = spheres_in_line(1), 0.2
    times = np.array([0.0, 0.5])
    lift = WallMotion(times, np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.5 * speed]]))
    setup = scene(
        grain,
        [resting(grain, 1)],
        plane(motion=lift),
        physics=still(gravity=G, restitution=0.3),
        duration=0.5,
    )
    movement = moved(setup)
    risen = movement.positions[0, 2] - setup.packing.positions[0, 2]
    assert risen == pytest.approx(speed * movement.end_time, rel=1e-6)
    # The start gives it m v^2 in a blow of no length, half of which the contact damps away.
    work = grain.mass * (G * risen + speed**2)
    assert movement.energy["wall_work"] == pytest.approx(work, rel=5e-3)
    assert abs(movement.energy["gain"]) < 2e-3 * work


@pytest.mark.parametrize("spin", [0.0, 3.0])
def test_a_plate_that_sways_takes_a_block_along_by_friction_only(spin: float) -> None:
    # The plate runs away under the block, which follows with mu g at first.
    speed, duration = 2.0, 0.2
    times = np.array([0.0, duration])
    run = WallMotion(times, np.array([[0.0, 0.0, 0.0], [speed * duration, 0.0, 0.0]]))
    setup = scene(
        sled(),
        [resting(sled(), 4)],
        plane(friction=MU, half=1.0, motion=run),
        physics=still(gravity=G, restitution=0.3),
        duration=duration,
        friction=MU,
    )
    movement = moved(setup)
    t = movement.end_time
    assert movement.velocities[0, 0] == pytest.approx(MU * G * t, rel=5e-3)
    pushed = MU * sled().mass * G * speed * t  # force times the way of the plate
    assert movement.energy["wall_work"] == pytest.approx(pushed, rel=5e-3)
    slid = MU * sled().mass * G * (speed * t - MU * G * t**2 / 2)
    assert movement.energy["slip"] == pytest.approx(slid, rel=5e-3)


def test_a_turned_plate_carries_a_block_round() -> None:
    # Slow enough for friction to hold it: it turns with the plate and keeps its place on it.
    duration, turn = 1.0, 0.5
    times = np.linspace(0.0, duration, 200)
    angles = turn * (times - np.sin(2 * math.pi * times) / (2 * math.pi))
    motion = WallMotion(times, np.zeros((200, 3)), angles, (0.0, 0.0, 1.0), (0.0, 0.1, 0.0))
    setup = scene(
        sled(),
        [resting(sled(), 4)],
        plane(friction=MU, motion=motion),
        physics=still(gravity=G, restitution=0.3),
        duration=duration,
        friction=MU,
    )
    movement = moved(setup)
    w, _, _, z = movement.orientations[0]
    assert 2 * math.atan2(z, w) == pytest.approx(turn, abs=1e-3)
    expected = [0.1 * math.sin(turn), 0.1 - 0.1 * math.cos(turn)]
    assert movement.positions[0, :2] == pytest.approx(expected, abs=1e-5)


def test_a_plate_that_tilts_lets_a_block_go_at_its_angle_of_friction() -> None:
    rate, duration = 1.0, 0.6
    times = np.array([0.0, duration])
    motion = WallMotion(times, np.zeros((2, 3)), rate * times, (0.0, 1.0, 0.0))
    stamps = np.arange(0.3, duration, 1e-3)
    setup = scene(
        sled(),
        [resting(sled(), 4)],
        plane(friction=MU, motion=motion),
        physics=still(gravity=G, restitution=0.3),
        duration=duration,
        friction=MU,
        snapshots=stamps,
    )
    movement = moved(setup)
    at = movement.snapshots["snapshot_times"]
    place = movement.snapshots["snapshot_positions"][:, 0]
    along = place[:, 0] * np.cos(rate * at) - place[:, 2] * np.sin(rate * at)
    slid = along - along[0]
    released = at[np.argmax(slid > 1e-5)]  # a little after it begins
    assert rate * released == pytest.approx(math.atan(MU), abs=0.02)


def balance(share: float) -> tuple[float, float]:
    """Work of a shaken plate on bouncing grains [J], and what the balance lacks [J]."""
    starts = [Start((0.05 * i, 0.0, (1.5 + 0.1 * i) * R)) for i in range(4)]
    setup = scene(
        spheres_in_line(3),
        starts,
        plane(friction=MU, motion=shaken(30.0, 1e-3, 0.3)),
        physics=still(gravity=G, restitution=0.8, contact_law="hertz"),
        duration=0.3,
        friction=MU,
    )
    movement = moved(setup, share)
    return movement.energy["wall_work"], movement.energy["gain"]


def test_the_work_of_a_shaken_plate_is_what_its_grains_gain() -> None:
    coarse, fine = balance(0.2), balance(0.05)
    assert fine[0] > 1e-4
    assert abs(coarse[1]) < 5e-3 * coarse[0]
    assert abs(fine[1]) < 0.25 * abs(coarse[1])


def flights() -> tuple[Array, Array]:
    heights = np.linspace(0.02, 0.3, 7)
    speeds = np.linspace(-0.5, 0.5, 7)
    return heights, speeds


def test_a_grain_leaves_when_and_where_it_passes_the_exit() -> None:
    # Between two steps its way is a line: off by g dt^2 / 8 of the parabola at most.
    heights, speeds = flights()
    starts = [
        Start((0.1 * i, 0.0, h), LEVEL, (v, 0.3, v))
        for i, (h, v) in enumerate(zip(heights, speeds, strict=True))
    ]
    setup = scene(spheres_in_line(5), starts, physics=still(gravity=G), duration=0.5, exit_z=0.0)
    movement = moved(setup, share=1.0)
    dt = movement.timestep
    times = (speeds + np.sqrt(speeds**2 + 2 * G * heights)) / G
    late = G * dt**2 / 8 / np.sqrt(speeds**2 + 2 * G * heights)
    assert (np.abs(movement.exit_times - times) <= late * (1 + 1e-6)).all()
    assert movement.positions[:, 2] == pytest.approx(np.zeros(7), abs=1e-12)
    assert movement.positions[:, 1] == pytest.approx(0.3 * movement.exit_times, rel=1e-9)
    assert movement.positions[:, 0] == pytest.approx(
        0.1 * np.arange(7) + speeds * movement.exit_times, rel=1e-9, abs=1e-12
    )
