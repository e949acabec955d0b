"""Free rotation of the compiled engine against rigid-body mechanics."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from benchmarks.engine.small_scenes import (
    LEVEL,
    LIMIT_S,
    R,
    Start,
    asymmetric,
    moved,
    scene,
    spheres_in_line,
    still,
    turned,
)
from fidelity.engine import Grain, Movement
from fidelity.engines.numba import NumbaEngine
from mfopt.arrays import Array

SPIN = (40.0, 1.0, 90.0)  # [rad/s] in space, near the unstable axis of the asymmetric grain
TILTED = (0.5, 0.5, -0.1, 0.7)


def spun(grain: Grain, timestep: float, *, duration: float = 0.5) -> Movement:
    """The free flight of a spinning grain."""
    orientation = np.array(TILTED) / np.linalg.norm(TILTED)
    spin = turned(orientation, np.array(SPIN))
    setup = scene(
        grain,
        [Start((0.0, 0.0, 0.0), orientation, spin=spin)],
        physics=still(),
        duration=duration,
    )
    movement = NumbaEngine(fixed_timestep=timestep).move(setup, time_limit_s=LIMIT_S)
    assert movement.status == "finished", movement.why
    return movement


def axes(quaternion: Array) -> Array:
    """The grain's axes in space, as rows."""
    return turned(quaternion, np.eye(3))


def reference(grain: Grain, duration: float) -> Array:
    """Orientation after Euler's equations, integrated to 1e-12."""
    inertia = grain.inertia

    def rates(_: float, y: Array) -> Array:
        spin, (w, x, y_, z) = y[:3], y[3:]
        turning = np.cross(inertia * spin, spin) / inertia
        a, b, c = spin
        quaternion = 0.5 * np.array(
            [
                -x * a - y_ * b - z * c,
                w * a + y_ * c - z * b,
                w * b + z * a - x * c,
                w * c + x * b - y_ * a,
            ]
        )
        return np.concatenate([turning, quaternion])

    orientation = np.array(TILTED) / np.linalg.norm(TILTED)
    start = np.concatenate([SPIN, orientation])
    done = solve_ivp(rates, (0.0, duration), start, method="DOP853", rtol=1e-12, atol=1e-12)
    return np.asarray(done.y[3:, -1])


@pytest.mark.parametrize("grain", [spheres_in_line(5), asymmetric()], ids=["line", "asymmetric"])
def test_orientation_follows_eulers_equations_to_second_order(grain: Grain) -> None:
    steps = (2e-5, 1e-5)
    errors = []
    for step in steps:
        movement = spun(grain, step)
        wanted = reference(grain, movement.end_time)
        errors.append(np.abs(axes(movement.orientations[0]) - axes(wanted)).max())
    assert errors[0] < 2e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


def test_the_axis_of_a_symmetric_grain_precesses_at_l_over_i() -> None:
    # About its angular momentum L, at the rate L / I across the axis.
    grain = spheres_in_line(5)
    momentum = grain.inertia * np.array(SPIN)
    period = 2 * math.pi * grain.inertia[1] / np.linalg.norm(momentum)
    movement = spun(grain, period / 2000, duration=10 * period)
    assert movement.end_time == pytest.approx(10 * period, rel=1e-9)
    start = np.array(TILTED) / np.linalg.norm(TILTED)
    before, after = axes(start)[0], axes(movement.orientations[0])[0]
    # Ten turns of 2000 steps: an error of 10 * 2 pi * (2 pi / 2000)^2 = 6e-4 or so.
    assert after == pytest.approx(before, abs=2e-3)
    halfway = spun(grain, period / 2000, duration=9.5 * period)
    assert np.abs(axes(halfway.orientations[0])[0] - before).max() > 0.1


def test_free_rotation_keeps_its_kinetic_energy_to_second_order() -> None:
    grain = asymmetric()
    energy = 0.5 * float(np.sum(grain.inertia * np.array(SPIN) ** 2))
    errors = [
        abs(spun(grain, step, duration=0.2).energy["kinetic"] / energy - 1) for step in (2e-5, 1e-5)
    ]
    assert errors[0] < 1e-6
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


def colliding() -> tuple[Movement, Movement, Grain]:
    """Two turning clumps with friction, before and after they met."""
    grain = spheres_in_line(5)
    starts = [
        Start((-2.2 * R, 0.0, 0.0), (0.8, 0.0, 0.6, 0.0), (0.4, 0.0, 0.1), (0.0, 20.0, 7.0)),
        Start((2.2 * R, R, 0.5 * R), (0.7, 0.1, 0.0, 0.7), (-0.5, 0.1, 0.0), (9.0, 0.0, -30.0)),
    ]
    setup = scene(grain, starts, physics=still(restitution=0.6), duration=0.05, friction=0.5)
    before = scene(grain, starts, physics=still(), duration=1e-9)
    return moved(before), moved(setup), grain


def test_linear_momentum_survives_a_collision_to_the_last_digit() -> None:
    before, after, _ = colliding()
    assert after.max_overlap > 0.01
    assert after.velocities.sum(axis=0) == pytest.approx(before.velocities.sum(axis=0), abs=1e-14)


def test_angular_momentum_survives_a_collision() -> None:
    # Of spheres it can be read to the last digit; friction moves it from flight to spin.
    grain = spheres_in_line(1)
    starts = [
        Start((-1.2 * R, 0.0, 0.0), LEVEL, (0.4, 0.0, 0.1), (0.0, 20.0, 7.0)),
        Start((1.2 * R, R, 0.5 * R), LEVEL, (-0.5, 0.1, 0.0), (9.0, 0.0, -30.0)),
    ]
    setup = scene(grain, starts, physics=still(restitution=0.6), duration=0.05, friction=0.5)
    movement = moved(setup)

    def total(x: Array, v: Array, w: Array) -> Array:
        return np.asarray((grain.mass * np.cross(x, v) + grain.inertia * w).sum(axis=0))

    velocities, spins = setup.velocities, setup.angular_velocities
    assert velocities is not None
    assert spins is not None
    before = total(setup.packing.positions, velocities, spins)
    after = total(movement.positions, movement.velocities, movement.angular_velocities)
    assert not np.allclose(movement.angular_velocities, spins, rtol=1e-3)
    assert after == pytest.approx(before, rel=1e-12, abs=1e-12 * np.abs(before).max())
