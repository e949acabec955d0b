import numpy as np

from surrogates.training import group_means, outputs, rows_of, scaling_of, spread_rows, subset
from surrogates.warp import Warp

IDENTITY = Warp(np.inf, 1.0)


def test_replicates_are_merged() -> None:
    z = np.array([[1.0, 0.0], [0.0, 0.0], [1.0, 0.0], [1.0, 0.0], [1.0, 0.0]])
    rows = rows_of(z, np.array([0, 0, 0, 2, 0]), np.array([1.0, 5.0, 3.0, 7.0, 8.0]))
    assert rows.levels == (0, 2)
    np.testing.assert_array_equal(rows.replicates, [1, 3, 1])
    np.testing.assert_array_equal(group_means(rows, rows.value), [5.0, 4.0, 7.0])
    np.testing.assert_array_equal(rows.starts, [0, 2])


def test_levels_are_centred_and_share_one_scale() -> None:
    rng = np.random.default_rng(2)
    z, level = rng.normal(3.0, 5.0, (40, 2)), np.repeat([0, 1], 20)
    value = np.where(level == 0, 1.0, 2.0) * rng.standard_normal(40) + 30.0 * level
    rows = rows_of(z, level, value)
    scaling = scaling_of(rows, IDENTITY)
    y = outputs(rows, IDENTITY, scaling)
    first, second = (y[rows.index == k] for k in (0, 1))
    assert abs(first.mean()) < 1e-12
    assert abs(second.mean()) < 1e-12
    assert abs(y.std() - 1.0) < 1e-12
    assert second.std() > 1.5 * first.std()
    np.testing.assert_allclose(scaling.inputs(z).std(axis=0), 1.0)


def test_thinning_keeps_the_small_level_and_spreads_over_the_values() -> None:
    rng = np.random.default_rng(3)
    z, level = rng.standard_normal((510, 2)), np.repeat([0, 1], [500, 10])
    rows = rows_of(z, level, rng.standard_normal(510))
    keep = spread_rows(rows, 60)
    assert len(keep) == len(set(keep.tolist())) == 60
    assert np.sum(rows.index[keep] == 1) == 10
    means = group_means(rows, rows.value)
    coarse, kept = means[rows.index == 0], means[keep[rows.index[keep] == 0]]
    assert (kept.min(), kept.max()) == (coarse.min(), coarse.max())
    assert abs(np.median(kept) - np.median(coarse)) < 0.1
    thin = subset(rows, keep)
    np.testing.assert_array_equal(group_means(thin, thin.value), means[keep])
