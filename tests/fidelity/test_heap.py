"""The heap scene: heaps of known angle, and a cylinder that is lifted off."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scene_portions import movement_to, portion_of

from fidelity.engines.bullet.engine import BulletEngine
from fidelity.grains.filling import filled
from fidelity.grains.portion import largest_overlap, sphere_centres
from fidelity.scenes.heap.run import (
    HeapSettings,
    cone_angle,
    filling_setup,
    heap_result,
    heap_setup,
    surface_height,
)
from geometry.mesh import Mesh
from mesh_checks import open_edges
from mfopt.arrays import Array
from mfopt.errors import ConfigError

SETTINGS = HeapSettings(radius=0.06, plate=0.5, lift_speed=0.3, lift_height=0.12, rest=0.2)
FINE = portion_of(1, length=0.01, width=0.01)  # beads in a heap of 0.2 m
DENSE = 10_000  # of them fill it


def cone(angle: float, radius: float, n: int, seed: int = 0) -> Array:
    """Points evenly spread in a cone with its foot at z = 0."""
    rng = np.random.default_rng(seed)
    slope = math.tan(angle)
    tries = rng.uniform(-1.0, 1.0, (6 * n, 3)) * [radius, radius, 1.0]
    tries[:, 2] = np.abs(tries[:, 2]) * radius * slope
    surface = (radius - np.linalg.norm(tries[:, :2], axis=1)) * slope
    return tries[tries[:, 2] < surface][:n]


@pytest.mark.parametrize("degrees", [15.0, 30.0, 40.0])
def test_the_angle_of_an_even_cone_is_found(degrees: float) -> None:
    positions = cone(math.radians(degrees), 0.2, 2 * DENSE)
    heap = heap_result(FINE.grain, movement_to(positions))
    # The tops of the highest spheres follow the surface at a distance that is the same all over.
    assert math.degrees(heap.angle) == pytest.approx(degrees, abs=0.7)
    assert heap.radius == pytest.approx(0.2, rel=0.02)
    assert heap.mean_height == pytest.approx(0.2 * math.tan(math.radians(degrees)) / 4, rel=0.02)


def test_the_angle_does_not_depend_on_place_or_heading_or_on_grains_that_rolled_away() -> None:
    positions = cone(math.radians(30), 0.2, DENSE)
    one = heap_result(FINE.grain, movement_to(positions))
    c, s = math.cos(0.5), math.sin(0.5)
    turned = positions @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]).T
    moved = heap_result(FINE.grain, movement_to(turned + np.array([0.03, -0.02, 0.0])))
    # The median place does not turn exactly with the heap.
    assert moved.angle == pytest.approx(one.angle, abs=math.radians(0.5))
    strays = np.column_stack([np.linspace(0.5, 0.9, 25), np.zeros((25, 2))])
    stray = heap_result(FINE.grain, movement_to(np.vstack([positions, strays])))
    assert stray.angle == pytest.approx(one.angle, abs=math.radians(0.5))


def test_a_heap_twice_as_large_has_the_same_angle() -> None:
    positions = cone(math.radians(25), 0.2, 3000)
    small = heap_result(FINE.grain, movement_to(positions))
    doubled = portion_of(1, length=0.02, width=0.02)
    large = heap_result(doubled.grain, movement_to(2 * positions))
    assert large.angle == pytest.approx(small.angle, rel=1e-9)
    np.testing.assert_allclose(large.heights, 2 * small.heights, rtol=1e-9, atol=1e-12)
    sized = heap_result(FINE.grain, movement_to(2 * positions), np.full(len(positions), 2.0))
    np.testing.assert_allclose(sized.heights, large.heights, rtol=1e-9, atol=1e-12)


def test_only_the_flank_counts() -> None:
    radii = np.linspace(0.0, 0.12, 25)  # of a heap of 0.1 m
    heights = 0.06 - 0.5 * radii
    heights[radii < 0.019] = 0.0
    heights[radii > 0.081] = 0.05
    assert cone_angle(radii, heights, 0.1) == pytest.approx(math.atan(0.5), rel=1e-9)


def test_the_surface_of_one_sphere_is_its_upper_half() -> None:
    centre, radius = np.array([[0.0, 0.0, 0.3]]), np.array([0.1])
    for distance in (0.0, 0.05, 0.09):
        expected = 0.3 + math.sqrt(0.1**2 - distance**2)
        assert surface_height(centre, radius, distance) == pytest.approx(expected)
    assert surface_height(centre, radius, 0.101) == 0.0


def test_grains_that_left_the_plate_do_not_count() -> None:
    positions = cone(math.radians(30), 0.2, 2000)
    one = heap_result(FINE.grain, movement_to(positions))
    away = np.vstack([positions, [[2.0, 0.0, -0.1]] * 500])
    times = np.concatenate([np.full(2000, np.nan), np.full(500, 0.4)])
    two = heap_result(FINE.grain, movement_to(away, exit_times=times))
    assert two.angle == one.angle
    assert (one.fallen, two.fallen) == (0, 500)


def test_no_grain_left_gives_no_angle() -> None:
    told = heap_result(FINE.grain, movement_to(np.zeros((2, 3)), exit_times=np.array([0.1, 0.2])))
    assert math.isnan(told.angle)
    assert told.fallen == 2


def test_the_portion_starts_inside_the_standing_cylinder() -> None:
    portion = portion_of(60)
    setup = filling_setup(SETTINGS, portion, seed=3)
    cylinder, plate = setup.walls
    centres = sphere_centres(setup.grain, setup.packing).reshape(-1, 3)
    r = float(portion.grain.radii.max())
    corner = cylinder.vertices[0, :2], cylinder.vertices[1, :2]
    inner = np.linalg.norm((corner[0] + corner[1]) / 2)  # to the middle of a side
    assert np.linalg.norm(centres[:, :2], axis=1).max() <= inner - r + 1e-12
    assert r <= centres[:, 2].min() < centres[:, 2].max() < cylinder.vertices[:, 2].max() - r
    assert largest_overlap(setup.grain, setup.packing) == 0.0
    rims = cylinder.vertices[open_edges(Mesh(cylinder.vertices, cylinder.triangles))][..., 2]
    assert np.all((rims == 0.0).all(axis=1) | (rims == rims.max()).all(axis=1))
    assert np.all(plate.vertices[:, 2] == 0.0)


def test_the_cylinder_is_lifted_at_its_speed_and_stays_up() -> None:
    portion = portion_of(20)
    setup = heap_setup(SETTINGS, portion, filling_setup(SETTINGS, portion, 1).packing)
    motion = setup.walls[0].motion
    assert motion is not None
    assert setup.walls[1].motion is None
    speed = np.diff(motion.displacements[:, 2]) / np.diff(motion.times)
    np.testing.assert_allclose(speed, SETTINGS.lift_speed)
    assert motion.displacements[-1, 2] == SETTINGS.lift_height
    assert setup.duration == pytest.approx(motion.times[-1] + SETTINGS.rest)


@pytest.mark.parametrize(
    ("settings", "name"),
    [
        (replace(SETTINGS, lift_speed=0.0), "lift_speed = 0"),
        (
            replace(SETTINGS, lift_speed=1e-12),
            "lift_speed = 1e-09 mm/s would .* limit of 60 s",
        ),
        (replace(SETTINGS, plate=0.1), "plate"),
    ],
)
def test_scenes_that_make_no_sense_are_refused(settings: HeapSettings, name: str) -> None:
    with pytest.raises(ConfigError, match=name):
        filling_setup(settings, portion_of(10), seed=1)


def test_lifting_the_cylinder_leaves_a_heap_around_its_axis() -> None:
    portion, engine = portion_of(60), BulletEngine()
    packing, _ = filled(engine, filling_setup(SETTINGS, portion, seed=1), time_limit_s=120.0)
    movement = engine.move(heap_setup(SETTINGS, portion, packing), time_limit_s=120.0)
    assert movement.status == "finished", movement.why
    heap = heap_result(portion.grain, movement)
    assert heap.fallen == 0
    away = np.linalg.norm(movement.positions[:, :2], axis=1)
    assert (away > SETTINGS.radius).sum() > 10  # none was outside before
    assert heap.mean_height < 0.8 * float(packing.positions[:, 2].mean())
    assert math.radians(3) < heap.angle < math.radians(50)
    assert np.all(np.diff(heap.heights[4:17:4]) < 0)  # lower from the axis to the foot
