"""What a real rig needs of an engine on springs: gravity aside, a wall's own friction, a gate."""

import math
from dataclasses import replace

import numpy as np
import pytest
from engine_scenes import LIMIT_S, G, on_springs

from benchmarks.engine.small_scenes import R, Start, plane, scene, sled, spheres_in_line
from fidelity.effects.switch import switched_on
from fidelity.engine import Engine, Movement, Physics, Setup, Wall
from fidelity.engines.bullet.engine import BulletEngine
from mfopt.errors import ConfigError

HERTZ = Physics(contact_law="hertz", restitution=0.3, damping=0.0, gravity=G)


def moved(engine: Engine, setup: Setup) -> Movement:
    movement = engine.move(setup, time_limit_s=LIMIT_S)
    assert movement.status == "finished", movement.why
    return movement


@on_springs
def test_free_fall_is_along_gravity(engine: Engine) -> None:
    setup = scene(spheres_in_line(1), [Start((0.0, 0.0, 0.0))], physics=HERTZ, duration=0.1)
    setup = switched_on(setup, "tilt", {"angle": 0.2, "azimuth": 1.0})
    movement = moved(engine, setup)
    aside = math.sin(0.2)
    direction = np.array([aside * math.cos(1.0), aside * math.sin(1.0), -math.cos(0.2)])
    speed = float(np.linalg.norm(movement.velocities[0]))
    assert movement.velocities[0] == pytest.approx(speed * direction, rel=1e-9)
    # Velocities belong to the middle of a step, or to the end of it.
    assert speed == pytest.approx(G * movement.end_time, abs=G * movement.timestep)


@on_springs
@pytest.mark.parametrize(("part", "hangs"), [(0.97, True), (1.03, False)])
def test_a_sphere_hangs_from_a_wall_up_to_its_pull_off_force(
    engine: Engine, part: float, hangs: bool
) -> None:
    reduced = R if engine.name == "numba" else 2 / 3 * R  # YADE takes a wall for a sphere of 2 R
    weight = spheres_in_line(1).mass * G
    # Off the line between the plane's two triangles, where YADE has two contacts.
    start = [Start((0.1, -0.2, -R + 1e-6))]
    setup = scene(spheres_in_line(1), start, plane(), physics=HERTZ, duration=0.1)
    setup = switched_on(setup, "cohesion", {"energy": weight / (part * 2 * math.pi * reduced)})
    sunk = -R - moved(engine, setup).positions[0, 2]
    assert bool(sunk < 0.0) is hangs


@on_springs
@pytest.mark.parametrize(("effect", "ends_in"), [("drag_linear", G / 20), ("drag_quadratic", 0.7)])
@pytest.mark.parametrize("scale", [1.0, 0.5])
def test_drag_ends_in_the_terminal_velocity(
    engine: Engine, effect: str, ends_in: float, scale: float
) -> None:
    # A half as large sphere feels Stokes' drag four times, Newton's twice.
    rate, power = (20.0, 2.0) if effect == "drag_linear" else (G / 0.7**2, 0.5)
    setup = scene(spheres_in_line(1), [Start((0.0, 0.0, 0.0))], physics=HERTZ, duration=0.8)
    setup = replace(setup, packing=replace(setup.packing, scales=np.array([scale])))
    movement = moved(engine, switched_on(setup, effect, {"rate": rate}))
    assert -movement.velocities[0, 2] == pytest.approx(ends_in * scale**power, rel=1e-4)


@on_springs
@pytest.mark.parametrize("friction", [0.2, 0.6])
def test_a_block_slides_on_a_tilted_plane_by_the_friction_of_that_wall(
    engine: Engine, friction: float
) -> None:
    # Grains and wall have 0.4; the wall's own friction counts, below and above it.
    slope = math.atan(friction) + 0.15
    floor = replace(plane(0.0, 0.4), friction_angle=math.atan(friction))
    setup = scene(sled(), [Start((0.0, 0.0, R))], floor, physics=HERTZ, duration=0.4, friction=0.4)
    setup = switched_on(setup, "tilt", {"angle": slope})
    movement = moved(engine, setup)
    expected = G * (math.sin(slope) - friction * math.cos(slope))
    # It begins without overlap, so friction sets in a moment later.
    assert movement.velocities[0, 0] == pytest.approx(expected * movement.end_time, rel=0.02)


@on_springs
def test_a_block_sticks_to_a_wall_rougher_than_itself(engine: Engine) -> None:
    floor = replace(plane(0.0, 0.4), friction_angle=math.atan(0.6))
    setup = scene(sled(), [Start((0.0, 0.0, R))], floor, physics=HERTZ, duration=0.4, friction=0.4)
    setup = switched_on(setup, "tilt", {"angle": math.atan(0.5)})
    assert abs(moved(engine, setup).positions[0, 0]) < 0.05 * R


def on_a_gate(until: float) -> Setup:
    """A sphere at rest on a plate that is gone from `until` [s] on, and one on another plate."""
    shift = np.array([2.0, 0.0, 0.0])
    beside = plane(0.0, 0.4)
    beside = replace(beside, name="beside", vertices=beside.vertices + shift)
    gate = replace(plane(0.0, 0.4), name="gate", until=until)
    starts = [Start((0.0, 0.0, R)), Start((2.0, 0.0, R))]
    return scene(
        spheres_in_line(1), starts, gate, beside, physics=HERTZ, duration=0.3, friction=0.4
    )


@on_springs
def test_a_grain_falls_freely_from_when_its_gate_is_gone(engine: Engine) -> None:
    movement = moved(engine, on_a_gate(0.1234))
    fallen, stays = movement.positions[:, 2] - R
    assert fallen == pytest.approx(-G * (movement.end_time - 0.1234) ** 2 / 2, rel=2e-3)
    assert abs(stays) < 0.05 * R


@on_springs
def test_a_gate_that_is_gone_before_the_start_holds_nothing(engine: Engine) -> None:
    movement = moved(engine, on_a_gate(0.0))
    assert movement.positions[0, 2] - R == pytest.approx(-G * movement.end_time**2 / 2, rel=2e-3)


@on_springs
def test_contacts_elsewhere_keep_their_histories_when_a_gate_goes(engine: Engine) -> None:
    # A block that its friction holds on a slope creeps as soon as its springs are forgotten.
    def block(*walls: Wall) -> Movement:
        floor = plane(0.0, 0.4)
        start = [Start((0.0, 0.0, R))]
        setup = scene(sled(), start, floor, *walls, physics=HERTZ, duration=0.3, friction=0.4)
        return moved(engine, switched_on(setup, "tilt", {"angle": math.atan(0.3)}))

    far = plane(0.0, 0.4)
    far = replace(far, name="gate", vertices=far.vertices + np.array([0.0, 3.0, 0.0]), until=0.15)
    gave = block().positions[0, 0]
    assert gave > 0.0
    assert block(far).positions[0, 0] == pytest.approx(gave, rel=1e-6)


@on_springs
def test_a_slow_gate_lets_a_grain_go_when_its_edge_has_passed(engine: Engine) -> None:
    # The edge begins at x = -0.5 m and moves with 1 m / 0.4 s.
    opening, x = 0.4, -0.2
    gate = replace(plane(), name="gate", until=0.0)
    setup = scene(spheres_in_line(1), [Start((x, 0.0, R))], gate, physics=HERTZ, duration=0.3)
    movement = moved(engine, switched_on(setup, "slow_gate", {"opening_time": opening}))
    passed = (0.5 + x) * opening
    # The gate sinks by a radius, and the grain rolls off its edge: a radius of the way each.
    slack = R * opening + math.sqrt(2 * R / G) * 0.2
    fell_for = math.sqrt(2 * (R - movement.positions[0, 2]) / G)
    assert movement.end_time - fell_for == pytest.approx(passed, abs=slack)


@on_springs
@pytest.mark.parametrize(("share_of_g", "leaves"), [(0.7, False), (2.0, True)])
def test_a_grain_leaves_a_vibrating_plate_above_the_acceleration_of_gravity(
    engine: Engine, share_of_g: float, leaves: bool
) -> None:
    frequency = 20.0
    amplitude = share_of_g * G / (2 * math.pi * frequency) ** 2
    floor = plane(0.0, 0.4)
    setup = scene(
        spheres_in_line(1),
        [Start((0.0, 0.0, R), velocity=(0.0, 0.0, 2 * math.pi * frequency * amplitude))],
        floor,
        physics=HERTZ,
        duration=0.2,
        snapshots=np.linspace(0.1, 0.19, 19),
    )
    setup = switched_on(setup, "vibration", {"amplitude": amplitude, "frequency": frequency})
    movement = moved(engine, setup)
    times = movement.snapshots["snapshot_times"]
    heights = movement.snapshots["snapshot_positions"][:, 0, 2]
    above = heights - R - amplitude * np.sin(2 * math.pi * frequency * times)
    assert bool(above.max() > 0.2 * R) is leaves


def test_bullet_refuses_walls_and_gravity_that_it_lacks() -> None:
    lacking = {
        "friction_angle of the wall 'plane' = 0.1": {"friction_angle": 0.1},
        "until of the wall 'plane' = 0.5": {"until": 0.5},
    }
    for message, change in lacking.items():
        floor = replace(plane(), **change)  # type: ignore[arg-type]
        setup = scene(spheres_in_line(1), [Start((0, 0, 1))], floor, physics=Physics(), duration=1)
        with pytest.raises(ConfigError, match=message):
            BulletEngine().move(setup, time_limit_s=LIMIT_S)
    aside = Physics(gravity_direction=(1.0, 0.0, 0.0))
    setup = scene(spheres_in_line(1), [Start((0, 0, 1))], physics=aside, duration=1)
    with pytest.raises(ConfigError, match="gravity_direction"):
        BulletEngine().move(setup, time_limit_s=LIMIT_S)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"gravity_direction": (0.0, 0.0, -2.0)}, "length 2"),
        ({"rolling_stiffness": 0.0}, "rolling_stiffness = 0 must be above 0"),
    ],
)
def test_physics_that_makes_no_sense_is_refused(change: dict[str, object], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        Physics(**change)  # type: ignore[arg-type]


def test_a_wall_that_makes_no_sense_is_refused() -> None:
    with pytest.raises(ConfigError, match="friction_angle = 2 rad"):
        replace(plane(), friction_angle=2.0)
    with pytest.raises(ConfigError, match="until = nan"):
        replace(plane(), until=math.nan)
