"""Cohesion, drag and body forces of the compiled engine against closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.engine.small_scenes import (
    LEVEL,
    YOUNG,
    G,
    R,
    Start,
    moved,
    plane,
    scene,
    spheres_in_line,
    still,
    wall_stiffness,
)
from fidelity.engine import BodyForce, Movement, Packing, Physics, Setup


def weight() -> float:
    """Weight of a sphere [N]."""
    return spheres_in_line(1).mass * G


def hanging(energy: float) -> Setup:
    """A sphere that touches a ceiling from below."""
    return scene(
        spheres_in_line(1),
        [Start((0.0, 0.0, -R + 1e-9))],
        plane(),
        physics=still(gravity=G, adhesion_energy=energy, restitution=0.3),
        duration=0.1,
    )


@pytest.mark.parametrize("part", [0.5, 0.99])
def test_a_sphere_hangs_where_adhesion_and_spring_hold_its_weight(part: float) -> None:
    setup = hanging(weight() / (part * 2 * math.pi * R))
    overlap = (2 * math.pi * R * setup.physics.adhesion_energy - weight()) / wall_stiffness()
    movement = moved(setup)
    assert R + movement.positions[0, 2] == pytest.approx(overlap, rel=1e-6)


def test_a_sphere_heavier_than_the_pull_off_force_falls() -> None:
    movement = moved(hanging(weight() / (1.01 * 2 * math.pi * R)))
    drop = -R - movement.positions[0, 2]
    # It is let go within a few steps, and from then on falls freely.
    assert drop == pytest.approx(G * movement.end_time**2 / 2, rel=0.02)


def test_two_spheres_are_torn_apart_by_two_pi_of_the_reduced_radius() -> None:
    # Two body forces pull them apart: below the pull-off force they stay together.
    energy, mass = 0.05, spheres_in_line(1).mass
    pull_off = 2 * math.pi * (R / 2) * energy

    flight = (0.0, 0.1, 0.0)  # both fly along

    def gap(part: float) -> float:
        a = part * pull_off / mass
        jets = (
            BodyForce((0.0, -1.0, -1.0), (1.0, 1.0, 1.0), (a, 0.0, 0.0)),
            BodyForce((-1.0, -1.0, -1.0), (0.0, 1.0, 1.0), (-a, 0.0, 0.0)),
        )
        overlap = 0.01 * pull_off / (YOUNG * R)  # adhesion, spring and pull balance, or just not
        starts = [
            Start((side * (R - overlap / 2), 0.0, 0.0), LEVEL, flight) for side in (-1.0, 1.0)
        ]
        physics = still(adhesion_energy=energy, restitution=0.3, body_forces=jets)
        movement = moved(scene(spheres_in_line(1), starts, physics=physics, duration=0.02))
        return float(movement.positions[1, 0] - movement.positions[0, 0]) - 2 * R

    assert gap(0.99) < 0.0
    assert gap(1.01) > 0.0


def falling(physics: Physics, scales: tuple[float, ...], duration: float) -> Movement:
    starts = [Start((0.1 * i, 0.0, 0.0)) for i in range(len(scales))]
    setup = scene(spheres_in_line(1), starts, physics=physics, duration=duration)
    return moved(replace(setup, packing=sized(setup.packing, scales)), share=1.0)


def sized(packing: Packing, scales: tuple[float, ...]) -> Packing:
    return replace(packing, scales=np.array(scales))


@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0])
def test_linear_drag_ends_in_g_over_k(scale: float) -> None:
    # Stokes: the deceleration goes with the inverse square of the size.
    rate = 20.0 / scale**2
    movement = falling(still(gravity=G, linear_drag=20.0), (scale,), duration=30 / rate)
    assert -movement.velocities[0, 2] == pytest.approx(G / rate, rel=1e-9)


@pytest.mark.parametrize("scale", [0.5, 1.0, 2.0])
def test_quadratic_drag_ends_in_the_root_of_g_over_k(scale: float) -> None:
    # Newton: the deceleration goes with the inverse of the size.
    rate = 10.0 / scale
    end = math.sqrt(G / rate)
    movement = falling(still(gravity=G, quadratic_drag=10.0), (scale,), duration=20 * end / G)
    assert -movement.velocities[0, 2] == pytest.approx(end, rel=1e-9)


def test_the_way_to_the_terminal_velocity_is_exponential() -> None:
    rate = 20.0
    movement = falling(still(gravity=G, linear_drag=rate), (1.0,), duration=1.5 / rate)
    t, dt = movement.end_time, movement.timestep
    expected = -G / rate * (1 - math.exp(-rate * (t - dt / 2)))
    # Drag acts with the velocity of half a step ago: an error of rate * dt / 2.
    assert movement.velocities[0, 2] == pytest.approx(expected, rel=rate * dt)


def test_a_body_force_acts_inside_its_box_and_nowhere_else() -> None:
    wind = (3.0, -2.0, 1.0)
    starts = [Start((0.0, 0.0, 0.0)), Start((0.0, 0.0, 0.5))]
    jet = BodyForce((-0.2, -0.2, -0.2), (0.2, 0.2, 0.2), wind)
    movement = moved(
        scene(spheres_in_line(5), starts, physics=still(body_forces=(jet,)), duration=0.1)
    )
    t, dt = movement.end_time, movement.timestep
    assert movement.velocities[0] == pytest.approx(np.array(wind) * (t - dt / 2), rel=1e-11)
    assert movement.positions[0] == pytest.approx(np.array(wind) * t**2 / 2, rel=1e-11)
    assert (movement.velocities[1] == 0.0).all()
    assert (movement.positions[1] == starts[1].position).all()
    gained = 0.5 * spheres_in_line(5).mass * np.sum((np.array(wind) * t) ** 2)
    assert movement.energy["force_work"] == pytest.approx(gained, rel=1e-2)


def test_a_grain_keeps_the_velocity_that_a_box_gave_it() -> None:
    # Through a jet of length s the squared speed grows by 2 a s.
    jet = BodyForce((0.0, -1.0, -1.0), (0.1, 1.0, 1.0), (20.0, 0.0, 0.0))
    start = Start((-0.05, 0.0, 0.0), LEVEL, (1.0, 0.0, 0.0))
    movement = moved(
        scene(spheres_in_line(1), [start], physics=still(body_forces=(jet,)), duration=0.3)
    )
    assert movement.positions[0, 0] > 0.1
    # It enters and leaves somewhere within a step: 20 m/s2 more or less for that long.
    expected = math.sqrt(1.0 + 2 * 20.0 * 0.1)
    assert movement.velocities[0, 0] == pytest.approx(expected, abs=40.0 * movement.timestep)


@pytest.mark.parametrize(
    "trace",
    [
        {"adhesion_energy": 1e-15},
        {"linear_drag": 1e-12},
        {"quadratic_drag": 1e-12},
        {"body_forces": (BodyForce((-1, -1, -1), (1, 1, 1), (1e-12, 0.0, 0.0)),)},
        {"damping": 1e-12},
    ],
    ids=lambda trace: next(iter(trace)),
)
def test_a_trace_of_any_physics_changes_next_to_nothing(trace: dict[str, object]) -> None:
    def end(**more: object) -> Movement:
        start = Start((0.0, 0.0, 1.5 * R), (0.9, 0.1, 0.4, 0.1), (0.3, 0.1, -0.2), (5.0, 8.0, 3.0))
        physics = still(**{"gravity": G, "restitution": 0.5, **more})
        floor = plane(0.0, 0.4)
        grain = spheres_in_line(3)
        return moved(scene(grain, [start], floor, physics=physics, duration=0.1, friction=0.4))

    without, with_trace = end(), end(**trace)
    assert with_trace.positions == pytest.approx(without.positions, abs=1e-9)
    assert with_trace.velocities == pytest.approx(without.velocities, abs=1e-7)
