"""Two samples compared: closed forms, level and power on synthetic runs."""

import math

import numpy as np
import pytest
from scipy import stats

from benchmarks.engine.statistics import (
    distribution_p,
    holm,
    permutation_p,
    relative_difference,
    runs_needed,
    smallest_p,
)
from mfopt.arrays import Array


def test_the_relative_difference_is_that_of_the_means() -> None:
    found = relative_difference(np.array([1.9, 2.0, 2.1]), np.array([2.1, 2.2, 2.3]))
    assert found.estimate == pytest.approx(0.1)
    assert found.low < 0.1 < found.high


def test_exchanging_the_samples_inverts_the_ratio() -> None:
    a, b = np.array([1.0, 1.2, 1.1, 0.9]), np.array([1.4, 1.6, 1.5])
    one, two = relative_difference(a, b), relative_difference(b, a)
    assert (1 + one.low) * (1 + two.high) == pytest.approx(1.0)
    assert (1 + one.estimate) * (1 + two.estimate) == pytest.approx(1.0)


def test_the_interval_is_welchs_for_a_small_scatter() -> None:
    rng = np.random.default_rng(4)
    a, b = 100 + rng.normal(0, 0.1, 10), 101 + rng.normal(0, 0.2, 7)
    welch = stats.ttest_ind(b, a, equal_var=False).confidence_interval(0.95)
    found = relative_difference(a, b)
    assert found.low == pytest.approx(welch.low / a.mean(), rel=0.02)
    assert found.high == pytest.approx(welch.high / a.mean(), rel=0.02)


@pytest.mark.parametrize(("n_a", "n_b"), [(10, 10), (3, 12), (3, 3)])
def test_intervals_hold_the_true_difference_as_often_as_they_say(n_a: int, n_b: int) -> None:
    rng = np.random.default_rng(7)
    held = 0
    for _ in range(2000):
        found = relative_difference(rng.normal(1, 0.08, n_a), rng.normal(1.05, 0.04, n_b))
        held += found.low <= 0.05 <= found.high
    # Welch's is a little conservative for three runs; the binomial scatter is 0.005.
    assert 0.93 <= held / 2000 <= 0.985


def test_inside_asks_for_the_whole_interval() -> None:
    found = relative_difference(np.array([1.0, 1.01, 0.99]), np.array([1.01, 1.02, 1.0]))
    assert found.inside(0.05)
    assert not found.inside(0.02)


def test_one_run_has_no_interval_and_means_of_zero_no_ratio() -> None:
    single = relative_difference(np.array([1.0]), np.array([1.1, 1.2]))
    assert single.estimate == pytest.approx(0.15)
    assert math.isnan(single.low)
    assert not single.inside(1.0)
    assert math.isnan(relative_difference(np.zeros(3), np.ones(3)).estimate)


def test_the_exact_p_is_the_share_of_splits_as_far_apart() -> None:
    # Of the 20 splits of 1..6 in threes only 1 2 3 against 4 5 6 and its mirror are as far.
    assert permutation_p(np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0])) == pytest.approx(0.1)


@pytest.mark.parametrize(("n_a", "n_b"), [(3, 3), (3, 5), (6, 6), (5, 12)])
def test_samples_without_overlap_give_the_smallest_p(n_a: int, n_b: int) -> None:
    a, b = np.linspace(0.0, 0.1, n_a), np.linspace(5.0, 5.2, n_b)
    assert permutation_p(a, b) == pytest.approx(smallest_p(n_a, n_b))


def test_drawn_splits_give_no_smaller_p_than_one_over_their_number() -> None:
    apart = np.arange(10.0), np.arange(100.0, 110.0)
    assert smallest_p(10, 10) <= permutation_p(*apart) <= 5 * smallest_p(10, 10)


def test_large_samples_agree_with_the_t_test() -> None:
    rng = np.random.default_rng(5)
    a, b = rng.normal(0.0, 1.0, 25), rng.normal(0.6, 1.5, 30)
    expected = stats.ttest_ind(a, b, equal_var=False).pvalue
    assert permutation_p(a, b) == pytest.approx(expected, rel=0.15)


def test_equal_samples_are_not_told_apart() -> None:
    assert permutation_p(np.ones(5), np.ones(6)) == 1.0


def test_the_scalar_test_keeps_its_level_and_finds_a_true_difference() -> None:
    rng = np.random.default_rng(6)
    null = [permutation_p(rng.normal(1, 0.1, 5), rng.normal(1, 0.1, 6)) for _ in range(400)]
    assert np.mean(np.array(null) < 0.05) < 0.05 + 3 * 0.011
    assert permutation_p(rng.normal(1, 0.05, 10), rng.normal(1.15, 0.05, 10)) < 0.001


def runs_of(
    rng: np.random.Generator, runs: int, *, late: float = 0.0, wide: float = 1.0
) -> list[Array]:
    """Runs of 200 grains each; all grains of a run come early or late together."""
    return [
        0.5 + late + rng.normal(0.0, 0.1) + wide * rng.gamma(4.0, 0.05, 200) for _ in range(runs)
    ]


def test_grains_of_one_run_do_not_count_as_independent() -> None:
    rng = np.random.default_rng(8)
    p_values, naive = [], []
    for _ in range(150):
        a, b = runs_of(rng, 5), runs_of(rng, 5)
        p_values.append(distribution_p(a, b)[0])
        naive.append(stats.ks_2samp(np.concatenate(a), np.concatenate(b)).pvalue)
    assert np.mean(np.array(p_values) < 0.05) < 0.05 + 3 * 0.018
    assert np.mean(np.array(naive) < 0.05) > 0.5  # what a test over grains would have said


@pytest.mark.parametrize("change", [{"late": 0.3}, {"wide": 2.5}], ids=["later", "wider"])
def test_another_distribution_is_found(change: dict[str, float]) -> None:
    rng = np.random.default_rng(9)
    p, distance = distribution_p(runs_of(rng, 10), runs_of(rng, 10, **change))
    assert p < 0.002
    assert 0.3 < distance <= 1.0


def test_the_distance_is_kolmogorovs() -> None:
    rng = np.random.default_rng(10)
    a, b = rng.normal(0, 1, 500), rng.normal(0.5, 1, 400)
    _, distance = distribution_p([a[:250], a[250:]], [b])
    assert distance == pytest.approx(stats.ks_2samp(a, b).statistic, abs=0.01)


def test_holm_as_computed_by_hand() -> None:
    assert holm([0.01, 0.04, 0.03]) == pytest.approx([0.03, 0.06, 0.06])
    assert holm([0.6, 0.7]) == [1.0, 1.0]
    assert holm([]) == []


def test_as_many_runs_as_are_said_to_be_needed_bring_the_interval_inside() -> None:
    rng = np.random.default_rng(4)
    pilot = rng.normal(1.0, 0.1, 4000)
    needed = runs_needed(pilot, pilot, 0.05)
    assert needed is not None
    assert needed == pytest.approx(2 * (1.96 * 0.1 / np.log(1.05)) ** 2, rel=0.1)  # 32
    # With that many the interval of two equal means is as wide as the limits, in the mean.
    reach = [
        np.log1p(d.high) - np.log1p(d.estimate)
        for d in (
            relative_difference(rng.normal(1.0, 0.1, needed), rng.normal(1.0, 0.1, needed))
            for _ in range(200)
        )
    ]
    assert np.mean(reach) == pytest.approx(np.log(1.05), rel=0.05)


def test_runs_needed_are_unknown_for_a_single_run() -> None:
    assert runs_needed(np.array([1.0]), np.array([1.0, 2.0]), 0.05) is None
