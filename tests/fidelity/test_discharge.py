"""The discharge scene: a tight hopper, and rates and counts with known answers."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scene_portions import movement_to, portion_of

from fidelity.engine import Setup, Wall
from fidelity.engines.bullet.engine import BulletEngine
from fidelity.engines.numba import NumbaEngine
from fidelity.grains.filling import filled
from fidelity.grains.portion import largest_overlap, sphere_centres
from fidelity.scenes.discharge import objectives
from fidelity.scenes.discharge.run import (
    Discharge,
    DischargeSettings,
    check_discharge,
    discharge_result,
    discharge_samples,
    discharge_setup,
    filling_setup,
    vessel,
)
from geometry.mesh import Mesh
from mesh_checks import DEGENERATE, merged, open_edges, smallest_quality, volume
from mfopt.arrays import Array
from mfopt.errors import ConfigError

SLOT = DischargeSettings(length=0.16, depth=0.10, opening=0.08, fall=0.035, duration=0.5)
HOLE = replace(SLOT, opening_depth=0.06)
WEDGE = replace(SLOT, floor_angle=math.radians(60))
PYRAMID = replace(HOLE, floor_angle=math.radians(60))
BARRED = replace(WEDGE, bar=0.03, bar_height=0.09)
TROUGH = replace(SLOT, opening=SLOT.length)  # no floor at all
EVERY = pytest.mark.parametrize(
    "settings",
    [SLOT, HOLE, WEDGE, PYRAMID, TROUGH],
    ids=["slot", "hole", "wedge", "pyramid", "trough"],
)


def mesh(wall: Wall) -> Mesh:
    return Mesh(wall.vertices, wall.triangles)


def wall_named(setup: Setup, name: str) -> Wall:
    return next(wall for wall in setup.walls if wall.name == name)


@EVERY
def test_the_hopper_is_open_only_at_top_and_outlet(settings: DischargeSettings) -> None:
    whole = merged([mesh(vessel(settings, portion_of(10), 0.3)[0])])
    assert smallest_quality(whole) > DEGENERATE
    heights = whole.vertices[open_edges(whole)][..., 2]
    assert np.all((heights == 0.0).all(axis=1) | (heights == heights.max()).all(axis=1))
    # Seen from above the floor covers all of the box but the outlet.
    a, b, c = np.moveaxis(whole.vertices[whole.triangles], 1, 0)
    floor = np.abs(np.cross(b - a, c - a)[:, 2]).sum() / 2
    expected = settings.length * settings.depth - math.prod(settings.outlet)
    assert floor == pytest.approx(expected, abs=1e-12)


def test_the_volume_is_that_of_box_and_wedge() -> None:
    top = 0.3
    walls = vessel(PYRAMID, portion_of(10), top)[0]
    floor = Mesh(walls.vertices[:4], np.array([[2, 1, 0], [3, 2, 0]]))
    roof = Mesh(walls.vertices[8:], np.array([[0, 1, 2], [0, 2, 3]]))
    h, (a, b) = PYRAMID.shoulder, PYRAMID.outlet
    box, outlet = PYRAMID.length * PYRAMID.depth, a * b
    middle = (PYRAMID.length + a) * (PYRAMID.depth + b) / 4
    # Simpson's rule is exact for a frustum: the area is quadratic in the height.
    expected = h * (outlet + 4 * middle + box) / 6 + (top - h) * box
    assert volume(merged([mesh(walls), floor, roof])) == pytest.approx(expected, rel=1e-12)
    assert h == pytest.approx(0.04 * math.sqrt(3))


@EVERY
def test_the_portion_starts_inside_the_closed_hopper(settings: DischargeSettings) -> None:
    portion = portion_of(60)
    setup = filling_setup(settings, portion, seed=3)
    centres = sphere_centres(setup.grain, setup.packing).reshape(-1, 3)
    r = float(portion.grain.radii.max())
    assert np.all(np.abs(centres[:, :2]) <= np.array([settings.length, settings.depth]) / 2 - r)
    assert centres[:, 2].min() >= settings.shoulder + r
    assert centres[:, 2].max() + r < wall_named(setup, "hopper").vertices[:, 2].max()
    assert largest_overlap(setup.grain, setup.packing) == 0.0
    gate = wall_named(setup, "gate")
    np.testing.assert_allclose(np.ptp(gate.vertices, axis=0), [*settings.outlet, 0.0])
    assert setup.settle
    assert setup.grain_material == portion.grain_material  # full friction


def test_the_run_has_no_gate_and_the_seed_decides_the_packing() -> None:
    portion = portion_of(20)
    one, two, other = (filling_setup(SLOT, portion, seed).packing.positions for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, two)
    assert np.abs(one - other).max() > 1e-3
    setup = discharge_setup(SLOT, portion, filling_setup(SLOT, portion, 1).packing)
    assert [wall.name for wall in setup.walls] == ["hopper"]
    assert (setup.exit_z, setup.duration, setup.settle) == (-SLOT.fall, SLOT.duration, False)


def test_columns_stand_on_the_floor_and_the_plane_is_the_outlet() -> None:
    samples = discharge_samples(PYRAMID, portion_of(10), np.linspace(0.0, 0.5, 6))
    columns, (outlet,) = samples.columns, samples.planes
    assert columns is not None
    assert (outlet.z, outlet.opening) == (0.0, (-0.04, 0.04, -0.03, 0.03))
    # 16 columns of a grain's width, 1 cm, of which 8 are over the outlet.
    np.testing.assert_allclose(columns.edges, np.linspace(-0.08, 0.08, 17), atol=1e-15)
    rise = math.sqrt(3) * np.array([0.035, 0.025, 0.015, 0.005])
    np.testing.assert_allclose(columns.floors, [*rise, *np.zeros(8), *rise[::-1]], atol=1e-15)


def uneven(n: int) -> Array:
    """Slow at both ends, 500 grains/s in between: 0.2 s for the middle 100 of 160, and so on."""
    slow = np.linspace(0.0, 1.0, n // 10, endpoint=False)
    steady = 1.0 + np.arange(n - 2 * len(slow)) / 500.0
    return np.concatenate([slow, steady, steady[-1] + 0.1 + slow])


def test_a_steady_flow_between_uneven_ends_has_its_own_rate() -> None:
    told = Discharge(uneven(200), grain_mass=0.002, left=0, lost=0)
    assert told.mass_flow_rate == pytest.approx(1.0, rel=1e-9)
    # The ends are slow: all the mass over all the time is far less.
    assert 0.4 / np.ptp(told.times) < 0.2


def test_the_rate_does_not_depend_on_when_the_flow_starts_and_scales_with_time() -> None:
    rng = np.random.default_rng(2)
    times = np.sort(rng.gamma(3.0, 0.1, 300))
    rate = Discharge(times, 0.001, 0, 0).mass_flow_rate
    assert Discharge(times + 5.0, 0.001, 0, 0).mass_flow_rate == pytest.approx(rate)
    assert Discharge(2 * times, 0.001, 0, 0).mass_flow_rate == pytest.approx(rate / 2)
    assert Discharge(times, 0.003, 0, 0).mass_flow_rate == pytest.approx(3 * rate)


def test_too_few_grains_have_no_rate() -> None:
    assert math.isnan(Discharge(np.array([0.1, 0.2, 0.3]), 0.001, 5, 0).mass_flow_rate)


def test_the_mass_counts_a_grain_from_its_time_on() -> None:
    told = Discharge(np.array([0.1, 0.2, 0.2, 0.4]), 0.5, 0, 0)
    sized = replace(told, scales=np.array([1.0, 2.0, 1.0, 0.5]))
    expected = 0.5 * np.array([0.0, 1.0, 10.0, 10.125])
    assert sized.mass(np.array([0.0, 0.1, 0.3, 0.4])) == pytest.approx(expected)
    np.testing.assert_allclose(told.mass(np.array([0.0, 0.1, 0.3, 9.0])), [0.0, 0.5, 1.5, 2.0])


def test_every_grain_is_counted_once() -> None:
    portion = portion_of(4)
    below = -SLOT.fall
    positions = np.array(
        [[0.0, 0.0, below], [0.0, 0.03, below], [0.0, 0.0, 0.1], [0.4, 0.0, below]]
    )
    movement = movement_to(positions, exit_times=np.array([0.4, 0.3, np.nan, 0.1]))
    told = discharge_result(SLOT, portion, movement)
    np.testing.assert_array_equal(told.times, [0.3, 0.4])
    sized = discharge_result(SLOT, portion, movement, np.array([1.0, 2.0, 3.0, 4.0]))
    np.testing.assert_array_equal(sized.scales, [2.0, 1.0])
    assert (told.left, told.lost) == (1, 1)


@pytest.mark.parametrize(
    ("settings", "name"),
    [
        (replace(SLOT, opening=0.2), "opening = 200 mm"),
        (replace(SLOT, opening_depth=0.0), "opening_depth = 0"),
        (replace(SLOT, duration=0.0), "duration = 0"),
        (replace(SLOT, floor_angle=math.radians(91.7)), "floor_angle = 91.7"),
    ],
)
def test_hoppers_that_cannot_be_built_are_refused(settings: DischargeSettings, name: str) -> None:
    with pytest.raises(ConfigError, match=name):
        check_discharge(settings)


@pytest.mark.parametrize(
    ("settings", "stay_at_most"), [(SLOT, 30), (WEDGE, 5)], ids=["slot", "wedge"]
)
def test_grains_run_out_of_the_hopper_through_the_outlet(
    settings: DischargeSettings, stay_at_most: int
) -> None:
    portion, engine = portion_of(40), BulletEngine()
    packing, _ = filled(engine, filling_setup(settings, portion, seed=1), time_limit_s=120.0)
    assert packing.positions[:, 2].min() > 0.0
    movement = engine.move(discharge_setup(settings, portion, packing), time_limit_s=120.0)
    assert movement.status == "finished", movement.why
    told = discharge_result(settings, portion, movement)
    assert told.lost == 0
    assert len(told.times) + told.left == 40
    assert told.left <= stay_at_most  # on a flat floor a layer beside the slot stays
    # None faster than a free fall from the outlet.
    assert told.times[0] > 0.5 * math.sqrt(2 * settings.fall / 9.81)


def test_the_bar_lies_across_the_hopper_at_its_height() -> None:
    bar = mesh(vessel(BARRED, portion_of(10), 0.3)[1])
    low, high = bar.vertices.min(axis=0), bar.vertices.max(axis=0)
    half = BARRED.depth / 2
    assert low == pytest.approx([-0.015, -half, 0.075], abs=1e-3)
    assert high == pytest.approx([0.015, half, 0.105], abs=1e-3)


def test_grains_start_above_the_bar_and_none_ends_in_it() -> None:
    portion = portion_of(60)
    setup = filling_setup(BARRED, portion, seed=1)
    centres = sphere_centres(portion.grain, setup.packing)
    assert centres[..., 2].min() > BARRED.bar_top
    packing, _ = filled(NumbaEngine(), setup, time_limit_s=300.0)
    spheres = sphere_centres(portion.grain, packing)
    from_axis = np.hypot(spheres[..., 0], spheres[..., 2] - BARRED.bar_height)
    assert from_axis.min() > BARRED.bar / 2


@pytest.mark.parametrize(("bar", "height"), [(0.2, 0.3), (0.03, 0.01)])
def test_a_bar_that_does_not_fit_is_refused(bar: float, height: float) -> None:
    with pytest.raises(ConfigError, match="bar"):
        check_discharge(replace(SLOT, bar=bar, bar_height=height))


def test_an_error_of_the_flow_needs_the_wanted_flow() -> None:
    with pytest.raises(ConfigError, match="'flow_error' needs mass_flow_rate_kg_s"):
        objectives.criteria(objectives.Wanted()).objective("flow_error")
    wanted = objectives.Wanted(mass_flow_rate_kg_s=0.3)
    assert objectives.criteria(wanted).objective("flow_error").name == "flow_error"
