import numpy as np
import pytest

from surrogates.warp import Warp, warp_of_count, warp_of_objective


def test_identity_up_to_the_knot_and_smooth_across_it() -> None:
    warp = Warp(2.0, 0.5)
    below = np.linspace(-1e6, 2.0, 5)
    np.testing.assert_array_equal(warp.forward(below), below)
    step = 1e-6
    left, right = warp.forward(np.array([2.0 - step, 2.0 + step])) - 2.0
    assert right == pytest.approx(-left, rel=1e-5)


def test_inverse_and_slope_belong_to_the_map() -> None:
    warp = Warp(2.0, 0.5)
    f = np.array([-3.0, 1.9, 2.1, 5.0, 1e6])
    np.testing.assert_allclose(warp.inverse(warp.forward(f)), f, rtol=1e-9)
    h = 1e-6 * np.abs(f)
    difference = (warp.forward(f + h) - warp.forward(f - h)) / (2.0 * h)
    np.testing.assert_allclose(warp.slope(f), difference, rtol=1e-4)


def test_moments_agree_with_draws() -> None:
    warp = Warp(0.0, 1.0)
    mean, variance = np.array([-1.0, 0.3, 1.0]), np.array([0.3, 0.2, 0.1])
    draws = np.random.default_rng(1).normal(mean, np.sqrt(variance), (200_000, 3))
    for floor in (-np.inf, 0.0):
        values = np.maximum(warp.inverse(draws), floor)
        first, second = warp.moments(mean, variance, np.inf, floor)
        np.testing.assert_allclose(first, values.mean(axis=0), rtol=0.02, atol=0.003)
        np.testing.assert_allclose(second, values.var(axis=0), rtol=0.03, atol=0.003)


def test_doubt_reaches_no_further_than_what_was_seen() -> None:
    warp = Warp(0.0, 1.0)
    vague = warp.moments(np.array([1.0]), np.array([400.0]), 30.0)
    assert vague[0][0] < 30.0
    assert np.sqrt(vague[1][0]) < 30.0
    beyond, _ = warp.moments(np.array([5.0]), np.array([1e-6]), 30.0)
    np.testing.assert_allclose(beyond, warp.inverse(np.array([5.0])), rtol=1e-3)


def test_the_knot_is_the_median_of_the_finest_level_with_enough_values() -> None:
    value = np.concatenate([np.arange(20.0), 100.0 + np.arange(11.0), [1e9]])
    level = np.repeat([0, 1, 2], [20, 11, 1])
    assert warp_of_objective(value, level) == Warp(105.0, 5.0)


def test_the_scale_is_positive_for_ties() -> None:
    ties = np.array([1.0] * 8 + [4.0] * 2)
    assert warp_of_objective(ties, np.zeros(10, dtype=np.int64)).scale == 3.0
    assert warp_of_objective(np.full(10, 7.0), np.zeros(10, dtype=np.int64)).scale == 7.0
    assert warp_of_count(np.array([0.0, 0.0, 0.4])) == Warp(0.0, 0.4)
