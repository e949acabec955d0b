"""Sliding, sticking and rolling of the compiled engine against closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.engine.small_scenes import (
    RATIO,
    G,
    R,
    Start,
    down,
    leaning,
    moved,
    off,
    plane,
    scene,
    sled,
    spheres_in_line,
    wall_stiffness,
)
from fidelity.engine import ContactLaw, Grain, Movement, Physics, Setup

MU = 0.4
LAWS: tuple[ContactLaw, ...] = ("linear", "hertz")


def on_slope(
    grain: Grain,
    slope: float,
    *,
    duration: float,
    friction: float = MU,
    contacts: int = 1,
    law: ContactLaw = "linear",
    rolling: float = 0.0,
    speed: float = 0.0,
    spin: float = 0.0,
) -> Setup:
    """A grain that lies on a slope, pressed in by its weight (linear law)."""
    overlap = grain.mass * G * math.cos(slope) / (contacts * wall_stiffness())
    start = Start((R - overlap) * off(slope), leaning(slope), speed * down(slope), (0.0, spin, 0.0))
    physics = Physics(
        contact_law=law, restitution=0.3, damping=0.0, gravity=G, rolling_friction=rolling
    )
    return scene(
        grain,
        [start],
        plane(slope, friction),
        physics=physics,
        duration=duration,
        friction=friction,
        snapshots=(duration / 2,),
    )


def travel(setup: Setup, movement: Movement, slope: float) -> tuple[float, float, float, float]:
    """Time [s] and way down the slope [m] at the snapshot, then at the end."""
    start = setup.packing.positions[0]
    middle = movement.snapshots["snapshot_positions"][0, 0]
    ways = [float((p - start) @ down(slope)) for p in (middle, movement.positions[0])]
    return float(movement.snapshots["snapshot_times"][0]), ways[0], movement.end_time, ways[1]


@pytest.mark.parametrize("law", LAWS)
def test_a_block_slides_above_the_angle_of_friction(law: ContactLaw) -> None:
    # A block of four spheres cannot roll: a = g (sin s - mu cos s), from rest.
    slope = math.radians(30)
    setup = on_slope(sled(), slope, duration=0.4, contacts=4, law=law)
    movement = moved(setup)
    expected = G * (math.sin(slope) - MU * math.cos(slope))
    half, near, whole, far = travel(setup, movement, slope)
    # The speed at the snapshot is not known: eliminate what the start adds, v0 t.
    acceleration = 2 * (far / whole - near / half) / (whole - half)
    assert acceleration == pytest.approx(expected, rel=2e-3)
    assert movement.velocities[0] @ down(slope) == pytest.approx(
        expected * (whole - movement.timestep / 2), rel=5e-3
    )


@pytest.mark.parametrize("law", LAWS)
def test_a_block_sticks_below_the_angle_of_friction(law: ContactLaw) -> None:
    slope = math.atan(MU) - math.radians(1)
    setup = on_slope(sled(), slope, duration=1.0, contacts=4, law=law)
    _, near, _, far = travel(setup, moved(setup), slope)
    # It gives by a few microns, and then creeps by nothing that numbers of size R show.
    assert near < 1e-2 * R
    assert abs(far - near) < 1e-12


def test_a_block_far_below_the_angle_of_friction_gives_by_the_shear_of_its_springs() -> None:
    slope = math.atan(MU / 10)
    setup = on_slope(sled(), slope, duration=0.5, contacts=4)
    _, _, _, far = travel(setup, moved(setup), slope)
    pull = setup.grain.mass * G * math.sin(slope)
    shear = pull / (4 * RATIO * wall_stiffness())
    # The pull acts above the plane and tilts it: its front springs give, its back springs rise.
    tilt = pull * R / (4 * wall_stiffness() * (2 * R) ** 2)
    assert far == pytest.approx(shear + tilt * R, rel=1e-2)


def test_a_block_thrown_on_a_level_plane_stops_after_its_way() -> None:
    # v^2 / (2 mu g), and then it stands still.
    speed = 0.5
    stop = speed / (MU * G)
    setup = on_slope(sled(), 0.0, duration=2.5 * stop, contacts=4, speed=speed)
    _, near, _, far = travel(setup, moved(setup), 0.0)
    assert far == pytest.approx(speed**2 / (2 * MU * G), rel=2e-3)
    assert abs(far - near) < 1e-9


def rolling_inertia(setup: Setup, slope: float) -> tuple[float, float]:
    """Arm [m] of the contact below a sphere's centre, and I / (m arm^2)."""
    grain = setup.grain
    arm = R - 0.5 * grain.mass * G * math.cos(slope) / wall_stiffness()
    return arm, float(grain.inertia[1] / (grain.mass * arm**2))


def test_a_sphere_rolls_down_without_slip() -> None:
    # a = g sin s / (1 + I / (m arm^2)): 5/7 of g sin s on a hard plane.
    slope = math.radians(20)
    setup = on_slope(spheres_in_line(1), slope, duration=0.5)
    movement = moved(setup)
    arm, inertia = rolling_inertia(setup, slope)
    expected = G * math.sin(slope) / (1 + inertia)
    assert expected == pytest.approx(5 / 7 * G * math.sin(slope), rel=0.02)
    t = movement.end_time - movement.timestep / 2
    assert movement.velocities[0] @ down(slope) == pytest.approx(expected * t, rel=1e-3)
    assert movement.angular_velocities[0, 1] * arm == pytest.approx(expected * t, rel=1e-3)


def test_a_sphere_thrown_flat_ends_in_rolling_at_five_sevenths_of_its_speed() -> None:
    # Friction turns it until it no longer slips; the angular momentum about the contact stays.
    setup = on_slope(spheres_in_line(1), 0.0, duration=0.4, speed=0.5)
    movement = moved(setup)
    arm, inertia = rolling_inertia(setup, 0.0)
    assert movement.velocities[0, 0] == pytest.approx(0.5 / (1 + inertia), rel=1e-3)
    assert movement.angular_velocities[0, 1] * arm == pytest.approx(0.5 / (1 + inertia), rel=1e-3)


def test_rolling_friction_slows_a_rolling_sphere_and_stops_it() -> None:
    # m v' = -f and I w' = f arm - mu_r R N with v = w arm give
    # v' = -mu_r g (R / arm) / (1 + I / (m arm^2)).
    speed, rolling = 0.2, 0.05
    setup = on_slope(
        spheres_in_line(1), 0.0, duration=1.0, rolling=rolling, speed=speed, spin=speed / R
    )
    arm, inertia = rolling_inertia(setup, 0.0)
    slowing = rolling * G * R / arm / (1 + inertia)
    stop = speed / slowing
    assert stop < 0.6
    movement = moved(setup)
    _, _, _, far = travel(setup, movement, 0.0)
    # The spring winds up over a way of the size of the overlap, and rocks back a little.
    assert far == pytest.approx(speed**2 / (2 * slowing), rel=0.01)
    assert abs(movement.velocities[0, 0]) < 0.01 * speed


@pytest.mark.parametrize(("part", "stays"), [(0.9, True), (1.1, False)])
def test_rolling_friction_holds_a_sphere_up_to_its_angle(part: float, stays: bool) -> None:
    rolling = 0.1
    slope = math.atan(part * rolling)
    setup = on_slope(spheres_in_line(1), slope, duration=1.0, rolling=rolling)
    movement = moved(setup)
    _, near, whole, far = travel(setup, movement, slope)
    if stays:
        assert abs(far - near) < 1e-4 * R
    else:
        arm, inertia = rolling_inertia(setup, slope)
        pull = G * (math.sin(slope) - rolling * R / arm * math.cos(slope)) / (1 + inertia)
        assert far == pytest.approx(pull * whole**2 / 2, rel=0.1)


@pytest.mark.parametrize("spring", [1e-4, 1e-3])
def test_a_soft_rolling_spring_rocks_a_sphere_with_its_frequency(spring: float) -> None:
    # (I + m arm^2) phi'' = -spring kt R^2 phi, as long as the moment is below its limit.
    speed, stiffness = 1e-3, spring * RATIO * wall_stiffness() * R**2
    setup = on_slope(
        spheres_in_line(1), 0.0, duration=0.4, rolling=0.1, speed=speed, spin=speed / R
    )
    arm, inertia = rolling_inertia(setup, 0.0)
    half_period = math.pi * math.sqrt((1 + inertia) * setup.grain.mass * arm**2 / stiffness)
    setup = replace(
        setup,
        physics=replace(setup.physics, rolling_stiffness=spring),
        duration=1.1 * half_period,
        snapshot_times=np.linspace(0.9, 1.1, 41) * half_period,
    )
    movement = moved(setup)
    times, x = (
        movement.snapshots["snapshot_times"],
        movement.snapshots["snapshot_positions"][:, 0, 0],
    )
    assert x[0] > 0.0 > x[-1]
    assert np.interp(0.0, x[::-1], times[::-1]) == pytest.approx(half_period, rel=0.01)


def test_a_trace_of_rolling_friction_changes_next_to_nothing() -> None:
    # The law has no threshold: what it does is proportional to it.
    def end(rolling: float) -> Movement:
        start = Start((0.0, 0.0, 1.5 * R), (0.9, 0.1, 0.4, 0.1), (0.3, 0.1, -0.2), (5.0, 8.0, 3.0))
        physics = Physics(restitution=0.5, damping=0.0, gravity=G, rolling_friction=rolling)
        floor = plane(0.0, MU)
        return moved(
            scene(spheres_in_line(3), [start], floor, physics=physics, duration=0.1, friction=MU)
        )

    without, trace = end(0.0), end(1e-12)
    assert not np.array_equal(without.positions, trace.positions)
    assert trace.positions == pytest.approx(without.positions, abs=1e-9)
    assert trace.velocities == pytest.approx(without.velocities, abs=1e-7)
