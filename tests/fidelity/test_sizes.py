"""Sizes of grains that differ: what is drawn, and that they stay from the loose grains on."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fidelity.engine import Material, Packing, Physics
from fidelity.engines.numba import NumbaEngine
from fidelity.grains.filling import Portion, Rained, filled, loose_in
from fidelity.grains.grain import line_grain
from fidelity.grains.packing import settled_packing
from fidelity.grains.portion import largest_overlap, sphere_centres, sphere_radii
from fidelity.grains.sizes import EQUAL, Sizes, drawn
from fidelity.scenes.discharge.run import DischargeSettings, filling_setup
from geometry.sections import Section
from mfopt.errors import ConfigError

D = 6e-3  # [m]
MATERIAL = Material(1e6, 0.3, math.atan(0.4), 1500.0)
SCATTERED = Sizes(scatter=0.2)
PORTION = Portion(
    line_grain(2 * D, D, 3, 1500.0),
    40,
    MATERIAL,
    MATERIAL,
    Physics(contact_law="hertz", restitution=0.5, damping=0.0),
    SCATTERED,
)
RIG = DischargeSettings(length=0.05, depth=0.03, opening=0.024, fall=0.03, duration=0.5)


@pytest.mark.parametrize("sizes", [EQUAL, Sizes(small_share=0.5), Sizes(small_ratio=0.5)])
def test_grains_that_are_all_alike_have_no_scales(sizes: Sizes) -> None:
    assert drawn(sizes, 100, 0) is None


def test_sizes_scatter_evenly_by_their_share_and_keep_the_mass() -> None:
    scales = drawn(SCATTERED, 2000, 3)
    assert scales is not None
    assert np.mean(scales**3) == pytest.approx(1.0, rel=1e-12)
    # Before the mass is restored they reach from 0.8 to 1.2, with the mean cube 1 + 0.2^2.
    raw = scales * math.cbrt(1.04)
    assert raw.min() == pytest.approx(0.8, abs=0.005)
    assert raw.max() == pytest.approx(1.2, abs=0.005)
    assert raw.std() == pytest.approx(0.2 / math.sqrt(3), rel=0.03)


def test_small_grains_are_the_share_that_is_asked_for() -> None:
    scales = drawn(Sizes(small_share=0.3, small_ratio=0.5), 101, 0)
    assert scales is not None
    values, counts = np.unique(scales.round(12), return_counts=True)
    assert values[0] / values[1] == pytest.approx(0.5, rel=1e-10)
    assert counts.tolist() == [30, 71]


def test_another_seed_draws_other_sizes_and_the_same_seed_the_same() -> None:
    one, two, three = (drawn(SCATTERED, 50, seed) for seed in (0, 0, 1))
    np.testing.assert_array_equal(one, two)
    assert not np.array_equal(one, three)


@pytest.mark.parametrize("seed", range(4))
def test_loose_grains_of_different_sizes_do_not_overlap(seed: int) -> None:
    loose = loose_in(PORTION, Section(RIG.length, RIG.depth, 0.0, 0.0), 0.0, seed)
    assert largest_overlap(PORTION.grain, loose) == 0.0
    centres, radii = sphere_centres(PORTION.grain, loose), sphere_radii(PORTION.grain, loose)
    assert (np.abs(centres[..., 1]) + radii < RIG.depth / 2).all()


def test_sphere_centres_and_overlap_follow_the_scales() -> None:
    # Two lying grains, one of twice the size, that touch end to end: 24 mm and 12 mm long.
    level = np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))
    for gap, overlap in ((1e-6, 0.0), (-0.3e-3, 0.1)):
        places = np.array([[0.0, 0.0, 0.0], [0.018 + gap, 0.0, 0.0]])
        packing = Packing(places, level, np.array([2.0, 1.0]))
        assert largest_overlap(PORTION.grain, packing) == pytest.approx(overlap, abs=1e-9)


def test_sizes_stay_through_filling_and_the_cache(tmp_path: Path) -> None:
    engine = NumbaEngine()
    setup = filling_setup(RIG, PORTION, 2)
    packing, _ = filled(engine, setup, time_limit_s=60.0)
    np.testing.assert_array_equal(packing.scales, setup.packing.scales)
    first, again = (
        settled_packing(engine, Rained(setup), tmp_path, time_limit_s=60.0) for _ in range(2)
    )
    assert again.cpu_s == 0.0  # taken from the cache
    for made in (first, again):
        np.testing.assert_array_equal(made.packing.scales, packing.scales)
        np.testing.assert_array_equal(made.packing.positions, packing.positions)


def test_a_kept_packing_whose_sizes_were_changed_is_made_again(tmp_path: Path) -> None:
    import h5py

    engine, filling = NumbaEngine(), Rained(filling_setup(RIG, replace(PORTION, grains=10), 0))
    made = settled_packing(engine, filling, tmp_path, time_limit_s=60.0)
    (path,) = tmp_path.glob("*.h5")
    with h5py.File(path, "r+") as file:
        file["scales"][0] = 0.5
    again = settled_packing(engine, filling, tmp_path, time_limit_s=60.0)
    np.testing.assert_array_equal(again.packing.scales, made.packing.scales)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"scatter": 1.0}, "scatter = 1 of sizes must be at least 0 and below 1"),
        ({"small_share": 1.1}, r"small_share = 1\.1 must lie in 0 to 1"),
        ({"small_ratio": 0.0}, "small_ratio = 0 must be at least 0.1"),
        ({"small_ratio": 1e-5}, "small_ratio = 1e-05 must be at least 0.1"),
    ],
)
def test_sizes_that_cannot_be_are_refused(given: dict[str, float], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        Sizes(**given)
