"""What is Bullet's own: units, friction and restitution, its time step, and pinched grains."""

import math
from dataclasses import replace

import numpy as np
import pytest

from fidelity.engine import Material, Packing, Physics, Setup, Wall, WallMotion
from fidelity.engines.bullet.engine import BulletEngine, remedy
from fidelity.engines.bullet.script import available_energy, safe_timestep
from fidelity.engines.bullet.world import friction_factors, restitution
from fidelity.grains.grain import line_grain
from mfopt.arrays import Array
from mfopt.errors import ConfigError

R = 5e-3  # [m]
G = 9.81  # [m/s2]
SMOOTH = Material(1e6, 0.3, 0.0, 1400.0)
ROUGH = Material(1e6, 0.3, math.atan(0.5), 1400.0)
NO_TURN = np.array([[1.0, 0.0, 0.0, 0.0]])


def plate(half: float = 0.5) -> Wall:
    corners = half * np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    return Wall("plate", corners, np.array([[0, 1, 2], [0, 2, 3]]), ROUGH)


def along_x(*distances: float) -> Array:
    return np.outer(distances, [1.0, 0.0, 0.0])


def single(*, z: float, spheres: int = 1) -> Setup:
    """One grain at height z above a plate."""
    length = (2 + 1.25 * (spheres - 1)) * R
    return Setup(
        grain=line_grain(length, 2 * R, spheres, 1400.0),
        packing=Packing(np.array([[0.0, 0.0, z]]), NO_TURN),
        grain_material=ROUGH,
        walls=(plate(),),
        physics=Physics(damping=0.2),
        duration=0.5,
        exit_z=-1.0,
    )


def test_pairs_have_the_tangent_of_the_smaller_friction_angle() -> None:
    wall = Material(1e6, 0.3, math.atan(0.3), 1400.0)
    grain, at_wall = friction_factors(ROUGH, wall)
    assert grain * grain == pytest.approx(0.5)
    assert grain * at_wall == pytest.approx(0.3)
    grain, at_wall = friction_factors(wall, ROUGH)
    assert grain * at_wall == pytest.approx(0.3)
    assert friction_factors(SMOOTH, ROUGH) == (0.0, 0.0)


@pytest.mark.parametrize(
    "physics", [Physics(damping=0.2), Physics(damping=0.6), Physics(restitution=0.4)]
)
def test_bounces_return_what_restitution_or_damping_leave_on_average(physics: Physics) -> None:
    # Spheres far apart from slightly different heights: each meets the plate at another moment
    # of a step.
    drops = 0.2 + 1e-4 * np.arange(40)
    positions = np.column_stack([0.02 * (np.arange(40) - 20), np.zeros(40), drops + R])
    time = 0.25
    setup = replace(
        single(z=0.0),
        packing=Packing(positions, np.repeat(NO_TURN, 40, axis=0)),
        physics=physics,
        duration=time,
    )
    movement = BulletEngine().move(setup, time_limit_s=60)
    down = np.sqrt(2 * drops / G)
    returned = (movement.velocities[:, 2] + G * (time - down)) / (G * down)
    assert returned.mean() == pytest.approx(restitution(setup.physics), abs=0.02)
    assert returned.max() < 1.0


def test_a_given_restitution_is_used_instead_of_the_damping() -> None:
    assert restitution(Physics(damping=0.0)) == 1.0
    assert restitution(Physics(damping=0.6)) == pytest.approx(0.5)
    assert restitution(Physics(damping=0.6, restitution=0.7)) == 0.7


def test_a_shorter_step_changes_free_fall_by_nothing() -> None:
    times = [
        BulletEngine(timestep_s=dt)
        .move(replace(single(z=0.5), walls=(), exit_z=0.0), time_limit_s=60)
        .exit_times[0]
        for dt in (1e-3, 2.5e-4)
    ]
    # Not first order in the step: a scheme with that error differs by 0.4 ms.
    assert times[0] == pytest.approx(times[1], abs=2e-6)
    assert times[0] == pytest.approx(math.sqrt(2 * 0.5 / G), abs=2e-6)


def test_the_step_is_shortened_for_fast_falls_small_grains_and_fast_walls() -> None:
    setup = single(z=0.3)
    dt = safe_timestep(setup, 1.0)
    assert dt * math.sqrt(2 * G * 0.3) == pytest.approx(0.5 * R)
    assert safe_timestep(setup, dt / 3) == dt / 3
    # Below the lowest wall nothing can be passed through; without walls there is no limit.
    assert safe_timestep(replace(setup, exit_z=-9.0), 1.0) == dt
    assert safe_timestep(replace(setup, walls=()), 1.0) == 1.0
    fast = WallMotion(np.array([0.0, 0.1, 0.2]), along_x(0.0, 1.0, 0.9))
    moving = replace(setup, walls=(replace(plate(), motion=fast),))
    assert safe_timestep(moving, 1.0) == pytest.approx(0.5 * R / 10.0)
    thrown = replace(setup, velocities=np.array([[3.0, 4.0, 12.0]]))
    assert safe_timestep(thrown, 1.0) == pytest.approx(0.5 * R / 13.0)
    small = replace(setup, packing=replace(setup.packing, scales=np.array([0.5])))
    assert safe_timestep(small, 1.0) == pytest.approx(dt / 2)


def test_available_energy_grows_by_the_height_lost() -> None:
    setup = single(z=0.3)
    lower = setup.packing.positions - np.array([0.0, 0.0, 0.2])
    gained = available_energy(setup, lower) - available_energy(setup, setup.packing.positions)
    assert gained == pytest.approx(setup.grain.mass * G * 0.2)


def test_available_energy_grows_by_what_the_start_brings() -> None:
    setup = single(z=0.3, spheres=5)
    where = setup.packing.positions
    still = available_energy(setup, where)
    spinning = replace(setup, angular_velocities=np.array([[0.0, 20.0, 0.0]]))
    turn = 0.5 * setup.grain.inertia[1] * 20.0**2
    assert available_energy(spinning, where) - still == pytest.approx(turn)
    flying = replace(setup, velocities=np.array([[0.0, 3.0, 0.0]]))
    assert available_energy(flying, where) - still == pytest.approx(2 * setup.grain.mass * 3.0**2)
    # Twice as large, a grain has 8 times the mass and reaches twice as high.
    double = replace(setup, packing=replace(setup.packing, scales=np.array([2.0])))
    assert available_energy(double, where) == pytest.approx(16 * still)


def test_a_grain_stays_on_a_thin_plate_whatever_its_speed() -> None:
    setup = replace(single(z=4.0, spheres=5), duration=1.2)  # arrives with 8.9 m/s
    movement = BulletEngine().move(setup, time_limit_s=60)
    assert movement.status == "finished", movement.why
    assert movement.positions[0, 2] > 0.5 * R


def test_a_pinched_grain_goes_past_the_moving_rim_and_not_through_the_fixed_edge() -> None:
    # A grain stands in a slit below z = 0 and reaches above it; a wall moving along +x shears it
    # off the slit's far side. It must stay on the slit's side of that wall.
    y, deep = 0.1, 0.08
    slit = [
        Wall(
            name,
            np.array([[x, -y, -deep], [x, y, -deep], [x, y, 0.0], [x, -y, 0.0]]),
            np.array([[0, 1, 2], [0, 2, 3]]),
            ROUGH,
        )
        for name, x in (("near", -0.02), ("far", 1.2 * R))
    ]
    floor = replace(plate(), vertices=plate().vertices - np.array([0.0, 0.0, deep]))
    rim = np.array([[-0.1, -y, 0.0], [-0.1, y, 0.0], [-0.1, y, 0.1], [-0.1, -y, 0.1]])
    push = WallMotion(np.array([0.0, 0.3]), along_x(0.0, 0.3))
    pusher = Wall("cup", rim, np.array([[0, 1, 2], [0, 2, 3]]), ROUGH, push)
    upright = np.array([[math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0]])
    grain = line_grain(20 * R, 2 * R, 13, 1400.0)
    setup = replace(
        single(z=0.0),
        grain=grain,
        packing=Packing(np.array([[0.0, 0.0, -deep + 10.05 * R]]), upright),
        walls=(floor, *slit, pusher),
        duration=0.4,
    )
    movement = BulletEngine().move(setup, time_limit_s=60)
    assert movement.status == "finished", movement.why
    x, _, z = movement.positions[0]
    assert -deep < z
    assert -0.02 < x < 2.5 * R


def test_bad_settings_are_refused() -> None:
    with pytest.raises(ConfigError, match="timestep_s"):
        BulletEngine(timestep_s=0.0)
    with pytest.raises(ConfigError, match="iterations"):
        BulletEngine(iterations=0)


def test_where_pybullet_is_missing_the_version_of_python_is_named() -> None:
    assert remedy((3, 11)) == "run `pip install pybullet`"
    assert "no wheel for Python 3.13: use Python 3.11" in remedy((3, 13))
