"""The laws that every grain engine must obey, on one grain or a few."""

import math
from dataclasses import replace

import numpy as np
import pytest
from engine_scenes import (
    GRAIN_MATERIAL,
    LIMIT_S,
    WALL_MATERIAL,
    G,
    R,
    box,
    level,
    line_of,
    on_every_engine,
    on_springs,
    setup_of,
    table,
    turned,
    upright,
)

from fidelity.engine import Engine, Packing, Physics, Wall


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
    velocities = np.array([[1.5, 0.0, 0.0]])
    movement = engine.move(replace(setup, velocities=velocities), time_limit_s=LIMIT_S)
    fall = math.sqrt(2 * 0.1 / G)
    assert movement.exit_times[0] == pytest.approx(fall, rel=5e-3)
    assert movement.positions[0, 0] == pytest.approx(1.5 * fall, abs=1.5 * 1.1e-3)  # next check
    assert movement.velocities[0, 0] == pytest.approx(1.5, rel=1e-9)


@on_every_engine
@pytest.mark.parametrize("spin", [(60.0, 0.0, 0.0), (0.0, 24.0, -32.0)])
def test_a_thrown_grain_turns_at_a_constant_rate(
    engine: Engine, spin: tuple[float, float, float]
) -> None:
    # About the long axis or one across it, the angular velocity is along the angular momentum.
    start = Packing(np.array([[0.1, 0.2, 0.3]]), upright(0.7))
    rate = turned(start.orientations[0], np.array(spin))
    velocity = np.array([[0.5, -1.0, 2.0]])
    setup = replace(
        setup_of(line_of(5), start, duration=0.2),
        velocities=velocity,
        angular_velocities=rate[None],
    )
    movement = engine.move(setup, time_limit_s=LIMIT_S)
    assert movement.status == "finished", movement.why
    t = movement.end_time
    flown = velocity[0] * t - [0.0, 0.0, G * t**2 / 2]
    assert movement.positions[0] == pytest.approx(start.positions[0] + flown, abs=1e-3)
    assert movement.angular_velocities[0] == pytest.approx(rate, abs=1e-3 * np.linalg.norm(rate))
    corners = np.eye(3)
    angle, axis = np.linalg.norm(rate) * t, rate / np.linalg.norm(rate)
    whole = np.array([math.cos(angle / 2), *(math.sin(angle / 2) * axis)])
    expected = turned(whole, turned(start.orientations[0], corners))
    assert turned(movement.orientations[0], corners) == pytest.approx(expected, abs=0.02)


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
    # Beside it a wall of another material lets another sphere slide faster.
    slope, frictions, time = math.radians(60), (0.3, 0.1), 0.25
    down = np.array([math.cos(slope), 0.0, -math.sin(slope)])
    normal = np.array([math.sin(slope), 0.0, math.cos(slope)])
    side = np.array([0.0, 0.2, 0.0])
    planes = [
        Wall(
            f"slope {mu}",
            np.array([0 * side, 1.2 * down, 1.2 * down + side, side]) - 0.2 * down + shift,
            np.array([[0, 1, 2], [0, 2, 3]]),
            replace(WALL_MATERIAL, friction_angle=math.atan(mu)),
        )
        for mu, shift in zip(frictions, (0 * side, -side), strict=True)
    ]
    starts = R * normal + np.array([0.5 * side, -0.5 * side])
    # Undamped: YADE's numerical damping acts on the contact's force too.
    setup = replace(
        setup_of(line_of(1), Packing(starts, level(2)), *planes, duration=time),
        exit_z=-2.0,
        physics=Physics(damping=0.0),
    )
    movement = engine.move(setup, time_limit_s=LIMIT_S)
    travelled = (movement.positions - starts) @ down
    expected = [
        G * (math.sin(slope) - mu * math.cos(slope)) * movement.end_time**2 / 2 for mu in frictions
    ]
    assert travelled == pytest.approx(expected, rel=0.02)


@on_every_engine
def test_grains_of_all_sizes_fall_alike_and_rest_at_their_own_radius(engine: Engine) -> None:
    scales = np.array([0.7, 1.0, 1.4])
    places = np.array([[0.0, -0.05, 0.0], [0.0, 0.0, 0.0], [0.0, 0.05, 0.0]])
    places[:, 2] = scales * R + 0.02
    setup = replace(
        setup_of(line_of(5), Packing(places, level(3), scales), table(-0.2, 0.2), duration=0.8),
        snapshot_times=np.array([0.05]),
    )
    movement = engine.move(setup, time_limit_s=LIMIT_S)
    assert movement.status == "finished", movement.why
    (time,) = movement.snapshots["snapshot_times"]
    (falling,) = movement.snapshots["snapshot_positions"]
    # No size falls faster; the first step counts whole in some engines and half in others.
    fall = places[:, 2] - falling[:, 2]
    assert fall == pytest.approx(np.full(3, fall[0]), rel=1e-6)
    assert fall[0] == pytest.approx(G * time**2 / 2, rel=0.01 + movement.timestep / time)
    assert movement.positions[:, 2] == pytest.approx(scales * R, rel=0.01)


@on_every_engine
@pytest.mark.parametrize("scale", [1.0, 1.5])
def test_a_push_at_its_end_turns_a_grain_by_its_own_mass_and_inertia(
    engine: Engine, scale: float
) -> None:
    # An impulse J at the arm a changes the velocity by J/m and the turning by J a / I.
    grain, arm = line_of(5), 2.5 * R * scale
    smooth = replace(GRAIN_MATERIAL, friction_angle=0.0)
    ledge = replace(table(0.8 * arm, 0.3), material=smooth)  # below the last sphere alone
    packing = Packing(np.array([[0.0, 0.0, 1.1 * R * scale]]), level(1), np.array([scale]))
    setup = replace(
        setup_of(grain, packing, ledge, duration=0.02),
        grain_material=smooth,
        physics=Physics(gravity=0.0, damping=0.0),
        velocities=np.array([[0.0, 0.0, -0.5]]),
    )
    movement = engine.move(setup, time_limit_s=LIMIT_S)
    assert movement.status == "finished", movement.why
    gained = movement.velocities[0, 2] + 0.5
    turning = -movement.angular_velocities[0, 1]
    assert turning > 10.0
    inertia, mass = scale**5 * grain.inertia[1], scale**3 * grain.mass
    assert gained / turning == pytest.approx(inertia / (mass * arm), rel=0.01)


@on_springs
def test_a_grain_at_rest_weighs_on_its_floor_and_on_no_other_wall(engine: Engine) -> None:
    # Viscous contacts come to rest; numerical damping would hold a part of the weight itself.
    setup = replace(
        setup_of(
            line_of(5),
            Packing(np.array([[0.01, 0.02, 1.05 * R]]), level(1)),
            box(0.2, 0.2, floor=False),
            table(-0.2, 0.2),
            duration=0.5,
        ),
        physics=Physics(contact_law="hertz", restitution=0.3, damping=0.0),
        snapshot_times=np.array([0.4, 0.45]),
    )
    movement = engine.move(setup, time_limit_s=LIMIT_S)
    assert movement.status == "finished", movement.why
    forces = movement.snapshots["snapshot_wall_forces"]
    weight = setup.grain.mass * G
    assert forces.shape == (2, 2, 3)
    assert forces[:, 0] == pytest.approx(np.zeros((2, 3)))
    assert forces[:, 1] == pytest.approx(
        np.tile([0.0, 0.0, -weight], (2, 1)), rel=1e-3, abs=1e-3 * weight
    )
