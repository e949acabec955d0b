"""A sphere that goes through a wall breaks the run: its overlap with the wall cannot show it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.engine.small_scenes import (
    DENSITY,
    LIMIT_S,
    RATIO,
    R,
    Start,
    plane,
    scene,
    spheres_in_line,
    still,
    turned,
)
from fidelity.engine import ContactLaw, Movement, Setup, WallMotion
from fidelity.engines.numba import NumbaEngine

SOFT = 1e5  # [Pa]
# The springs of a wall as soft as the sphere stop its centre at the surface at these speeds [m/s]:
# m v^2 / 2 = 2 E R^3 / 3 with linear springs, 4 E R^3 / (15 (1 - nu^2)) with Hertz's.
MASS = 4 / 3 * math.pi * DENSITY  # over R^3
LIMITS: dict[ContactLaw, float] = {
    "linear": math.sqrt(4 / 3 * SOFT / MASS),
    "hertz": math.sqrt(8 / 15 * SOFT / (1 - RATIO**2) / MASS),
}
TOO_FAST = 8.0  # [m/s]


def run(setup: Setup) -> Movement:
    return NumbaEngine().move(setup, time_limit_s=LIMIT_S)


def shot(
    speed: float, *, law: ContactLaw = "linear", spheres: int = 1, angle: float = 0.0
) -> Setup:
    """A grain turned about y by `angle` that flies down to a plane."""
    turn = (math.cos(angle / 2), 0.0, math.sin(angle / 2), 0.0)
    grain = spheres_in_line(spheres)
    lowest = turned(np.array(turn), grain.offsets)[:, 2].min() - R
    start = Start((0.01, 0.02, 1e-3 - lowest), turn, (0.0, 0.0, -speed))
    physics = still(contact_law=law)
    return scene(grain, [start], plane(young=SOFT), physics=physics, duration=0.02, young=SOFT)


@pytest.mark.parametrize("law", LIMITS)
def test_a_sphere_that_is_stopped_in_time_comes_back(law: ContactLaw) -> None:
    speed = 0.9 * LIMITS[law]
    movement = run(shot(speed, law=law))
    assert movement.status == "finished", movement.why
    assert movement.velocities[0, 2] == pytest.approx(speed, rel=0.05)
    assert 0.8 < movement.max_overlap < 1.0


@pytest.mark.parametrize("law", LIMITS)
@pytest.mark.parametrize("times", [1.1, 1.7, 2.3])
def test_a_sphere_that_is_too_fast_goes_through(law: ContactLaw, times: float) -> None:
    movement = run(shot(times * LIMITS[law], law=law))
    assert movement.status == "crashed"
    assert "went through the wall 'plane'" in (movement.why or "")


@pytest.mark.parametrize("degrees", [0.0, 20.0, 60.0, 90.0])
def test_a_clump_goes_through_with_any_of_its_spheres(degrees: float) -> None:
    movement = run(shot(2 * TOO_FAST / 3, spheres=5, angle=math.radians(degrees)))
    assert movement.status == "crashed"
    assert "went through the wall 'plane'" in (movement.why or "")


@pytest.mark.parametrize("speed", [30.0, 300.0])
def test_a_sphere_that_could_fly_through_unseen_is_told(speed: float) -> None:
    movement = run(shot(speed))
    assert movement.status == "crashed"
    assert "smallest radius in a step" in (movement.why or "")


@pytest.mark.parametrize("slope", [0.0, 0.3])
def test_a_centre_in_the_plane_of_a_wall_is_told(slope: float) -> None:
    start = Start((0.02 * math.cos(slope), 0.01, -0.02 * math.sin(slope)))
    movement = run(scene(spheres_in_line(1), [start], plane(slope), physics=still(), duration=1e-3))
    assert movement.status == "crashed"
    assert "went through the wall 'plane'" in (movement.why or "")


@pytest.mark.parametrize("turning", [False, True])
def test_a_wall_that_hits_a_sphere_goes_through_as_well(turning: bool) -> None:
    times = np.array([0.0, 0.1])
    if turning:  # about an edge of the plane half a metre away
        way, angles = np.zeros((2, 3)), TOO_FAST / 0.5 * times
    else:
        way, angles = np.outer(TOO_FAST * times, [0.0, 0.0, 1.0]), None
    motion = WallMotion(times, way, angles, (0.0, 1.0, 0.0), (0.5, 0.0, 0.0))
    wall = plane(young=SOFT, motion=motion)
    start = Start((0.0, 0.0, R + 1e-3))
    setup = scene(spheres_in_line(1), [start], wall, physics=still(), duration=0.01, young=SOFT)
    movement = run(setup)
    assert movement.status == "crashed"
    assert "went through the wall 'plane'" in (movement.why or "")


def test_a_small_grain_that_a_large_one_pushes_through_the_floor_is_told() -> None:
    small, large = 0.5, 2.0
    starts = [
        Start((0.0, 0.0, R * small)),
        Start((0.0, 0.0, R * (2 * small + large)), velocity=(0.0, 0.0, -4.0)),
    ]
    setup = scene(spheres_in_line(1), starts, plane(), physics=still(), duration=0.01)
    sizes = np.array([small, large])
    movement = run(replace(setup, packing=replace(setup.packing, scales=sizes)))
    assert movement.status == "crashed"
    assert "went through the wall 'plane'" in (movement.why or "")


def test_a_sphere_that_passes_beside_an_edge_goes_on() -> None:
    # Almost all of the sphere's radius overlaps with the edge, but no wall is in the centre's way.
    beside = Start((0.5 + 0.1 * R, 0.0, 2 * R), velocity=(0.0, 0.0, -20.0))
    movement = run(scene(spheres_in_line(1), [beside], plane(), physics=still(), duration=2e-3))
    assert movement.status == "finished", movement.why
    assert movement.max_overlap > 0.8
    assert movement.positions[0, 2] < -R


def test_a_scene_may_let_walls_press_grains_through() -> None:
    setup = replace(shot(TOO_FAST), duration=2e-3, may_pinch=True)
    assert "went through" not in (run(setup).why or "")
