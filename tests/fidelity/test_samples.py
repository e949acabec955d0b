"""Reductions with known answers: levels of blocks and slopes, passages of straight ways."""

from dataclasses import replace

import numpy as np
import pytest
from yade_scenes import BOXED

from fidelity.samples import (
    Columns,
    Plane,
    Samples,
    begin,
    column_levels,
    even_columns,
    level_means,
    look,
    passage_times,
    passed_share,
    series,
)
from mfopt.arrays import Array
from mfopt.errors import ConfigError

D = 0.005  # [m] diameter of the spheres
NO_SPHERES = np.empty((0, 4))


def block(length: int, depth: int, layers: int) -> Array:
    """Spheres (m, 4) [m] in a cubic lattice on the floor z = 0, the first one in the corner."""
    grid = np.indices((length, depth, layers)).reshape(3, -1).T
    return np.column_stack([(grid + 0.5) * D, np.full(len(grid), D / 2)])


@pytest.mark.parametrize("layers", [1, 7])
def test_a_block_is_as_high_as_it_is(layers: int) -> None:
    columns = even_columns(0.0, 24 * D, D)
    levels = column_levels(columns, block(24, 6, layers))
    assert levels.shape == (24,)
    np.testing.assert_allclose(levels, layers * D, rtol=1e-12)
    for mean in level_means(columns, levels[None]):
        np.testing.assert_allclose(mean, [layers * D], rtol=1e-12)


def test_the_order_and_the_depth_of_the_spheres_do_not_matter() -> None:
    rng = np.random.default_rng(4)
    columns = even_columns(-0.06, 0.06, D)
    spheres = rng.uniform(-0.06, 0.06, (500, 4)) * [1, 1, 1, 0] + [0, 0, 0.06, D / 2]
    levels = column_levels(columns, spheres)
    moved = rng.permutation(spheres) + np.array([0.0, 3.0, 0.0, 0.0])
    np.testing.assert_array_equal(column_levels(columns, moved), levels)
    # What is no higher than the surface hides behind it.
    lower = spheres - [0, 0, 0.01, 0]
    np.testing.assert_array_equal(column_levels(columns, np.vstack([lower, spheres])), levels)


@pytest.mark.parametrize("count", [8, 9])
def test_the_halves_of_a_slope_differ_as_it_rises(count: int) -> None:
    slope, middle, length = 0.3, 0.05, count * D
    columns = even_columns(-length / 2, length / 2, D)
    x = (columns.edges[:-1] + columns.edges[1:]) / 2
    spheres = np.column_stack([x, 0 * x, middle + slope * x - D / 2, np.full(count, D / 2)])
    mean, left, right = level_means(columns, column_levels(columns, spheres)[None])
    half = count // 2  # whole columns in each half; of 9 the middle one is shared
    mid = (half / 2 if count == 8 else half * (half + 1) / count) * D  # [m] of a half's level
    assert mean[0] == pytest.approx(middle, rel=1e-12)
    assert right[0] - mean[0] == pytest.approx(slope * mid, rel=1e-12)
    assert mean[0] - left[0] == pytest.approx(slope * mid, rel=1e-12)


def test_an_empty_column_shows_the_floor() -> None:
    columns = Columns(D * np.arange(5.0), np.array([0.0, 0.001, 0.002, 0.003]))
    spheres = np.array(
        [
            [0.5 * D, 0.0, 0.02, D / 2],
            [2.5 * D, 0.0, -0.05, D / 2],  # fell through the outlet
            [4.5 * D, 0.0, 0.07, D / 2],  # beside the columns, as the next
            [-0.5 * D, 0.0, 0.07, D / 2],
        ]
    )
    levels = column_levels(columns, spheres)
    np.testing.assert_allclose(levels, [0.02 + D / 2, 0.001, 0.002, 0.003], rtol=1e-12)
    np.testing.assert_array_equal(column_levels(columns, NO_SPHERES), columns.floors)


def test_columns_are_as_near_to_a_grain_as_fits() -> None:
    columns = even_columns(-0.06, 0.06, 0.0051, floor=0.004)
    assert len(columns.floors) == 24
    np.testing.assert_allclose(np.diff(columns.edges), 0.005, rtol=1e-12)
    assert set(columns.floors) == {0.004}
    assert len(even_columns(0.0, 0.001, 0.01).floors) == 1


def test_a_straight_way_meets_the_plane_in_proportion() -> None:
    before = np.array([[0.0, 0.0, 3.0], [0.0, 0.0, 3.0], [0.0, 0.0, -1.0], [5.0, 0.0, 3.0]])
    after = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 0.5], [0.0, 0.0, 3.0], [9.0, 0.0, -1.0]])
    times = passage_times(Plane(0.0), 10.0, before, 14.0, after)
    np.testing.assert_allclose(times, [13.0, np.nan, np.nan, 13.0])
    # The last one meets the plane at x = 8.
    for x_to, passes in ((7.9, False), (8.1, True)):
        opening = Plane(0.0, (-1.0, x_to, -1.0, 1.0))
        times = passage_times(opening, 10.0, before, 14.0, after)
        assert np.isfinite(times).tolist() == [True, False, False, passes]


def test_every_side_bounds_an_opening_in_the_way_and_at_the_start() -> None:
    xy = np.array([[0, 0], [-2, 0], [2, 0], [0, -3], [0, 3]])
    above, below = (np.column_stack([xy, np.full(5, z)]) for z in (1.0, -1.0))
    plane = Plane(0.0, (-1.0, 1.0, -2.0, 2.0))
    passed = passage_times(plane, 0.0, above, 1.0, below)
    np.testing.assert_array_equal(passed, [0.5, *np.full(4, np.nan)])
    start = begin(Samples(np.array([0.0]), (plane,)), below, no_spheres)
    np.testing.assert_array_equal(start.passages, [[0.0, *np.full(4, np.nan)]])


def test_shares_are_of_the_mass() -> None:
    passages = np.array([[0.1, 0.2, np.nan], [0.15, np.nan, np.nan]])
    shares = passed_share(passages, np.array([1.0, 2.0, 5.0]), np.array([0.0, 0.1, 0.15, 0.3]))
    expected = np.array([[0, 0], [1, 0], [1, 1], [3, 1]]) / 8
    np.testing.assert_allclose(shares, expected, rtol=1e-12)


def heights(*z: float) -> Array:
    return np.column_stack([np.zeros((len(z), 2)), z])


def test_only_the_first_passage_counts_and_what_starts_below_has_passed() -> None:
    sampling = begin(Samples(np.array([0.0, 4.0]), (Plane(0.0),)), heights(1, -1), no_spheres)
    for now, z in ((1.0, -1.0), (2.0, 1.0), (3.0, -1.0), (4.0, 1.0)):
        look(sampling, now, heights(z, z), no_spheres)
    kept = series(sampling, np.ones(2), no_spheres, finished=True)
    np.testing.assert_array_equal(kept["passage_times"], [[0.5, 0.0]])
    np.testing.assert_array_equal(kept["passed"], [[0.5], [1.0]])


def no_spheres() -> Array:
    return NO_SPHERES


def one_column(top: float) -> Array:
    """A sphere (1, 4) [m] that reaches up to `top`."""
    return np.array([[0.0, 0.0, top - D / 2, D / 2]])


@pytest.mark.parametrize("finished", [True, False])
def test_samples_are_taken_at_the_next_look_and_held_after_a_good_end(finished: bool) -> None:
    samples = Samples(
        np.array([0.0, 1.5, 1.6, 3.0, 8.0, 9.0]), (Plane(0.0),), even_columns(-D, D, 2 * D)
    )
    sampling = begin(samples, heights(5.0), lambda: one_column(1.0))
    for now in (1.0, 2.0, 3.0, 4.0):
        look(sampling, now, heights(5 - 2 * now), lambda now=now: one_column(1.0 + now))
    kept = series(sampling, np.ones(1), lambda: one_column(6.0), finished=finished)
    s = 6 if finished else 4
    assert kept["sample_times"].tolist() == [0.0, 2.0, 2.0, 3.0, 8.0, 9.0][:s]
    assert kept["levels"].ravel() == pytest.approx([1.0, 3.0, 3.0, 4.0, 6.0, 6.0][:s])
    assert kept["passed"].ravel().tolist() == [0.0, 0.0, 0.0, 1.0, 1.0, 1.0][:s]
    assert kept["levels"].shape == kept["passed"].shape == (s, 1)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Samples(np.array([0.0, 0.2, 0.2])), "steps between sampling times"),
        (lambda: Samples(np.array([-0.1, 0.2])), "first sampling time = -0.1 s"),
        (lambda: Samples(np.array([0.1, np.nan])), "sampling times"),
        (lambda: Plane(0.0, (0.1, -0.1, 0.0, 1.0)), "sides of an opening"),
        (lambda: Columns(np.array([0.0, 0.2, 0.1]), np.zeros(2)), "widths of columns"),
        (lambda: Columns(np.array([0.0]), np.empty(0)), "0 columns"),
        (lambda: replace(BOXED, samples=Samples(np.array([0.1, 9.0]))), "9 s must be at most"),
        (
            lambda: replace(BOXED, samples=Samples(np.array([0.1]), (Plane(-2.0),))),
            "z = -2 m must be at least at the exit, -1 m",
        ),
    ],
)
def test_what_cannot_be_sampled_is_refused(make: object, said: str) -> None:
    assert callable(make)
    with pytest.raises(ConfigError, match=said):
        make()
