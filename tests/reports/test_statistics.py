"""Order statistics against closed forms, and comparisons against hand-computed values."""

import math

import numpy as np
import pytest

from reports.statistics import Comparison, coverage, median_interval


def test_coverage_of_the_whole_range_misses_only_if_all_values_lie_on_one_side() -> None:
    for n in range(2, 12):
        assert coverage(n, 1) == pytest.approx(1.0 - 2.0 * 0.5**n, rel=1e-12)


def test_five_seeds_give_the_whole_range() -> None:
    interval = median_interval(np.array([3.0, 1.0, 5.0, 2.0, 4.0]))
    assert interval is not None
    assert (interval.low, interval.high, interval.coverage) == (1.0, 5.0, 0.9375)


def test_nine_seeds_drop_the_extremes() -> None:
    # 1 - 2 (1 + 9) / 2**9, as tables of the sign test give it
    interval = median_interval(np.arange(9.0))
    assert interval is not None
    assert (interval.low, interval.high) == (1.0, 7.0)
    assert interval.coverage == pytest.approx(1.0 - 20.0 / 512.0)


def test_intervals_hold_the_median_as_often_as_they_say() -> None:
    rng = np.random.default_rng(11)
    samples = rng.exponential(size=(4000, 7))
    intervals = [median_interval(s) for s in samples]
    held = np.mean([i.low <= math.log(2.0) <= i.high for i in intervals if i is not None])
    assert held == pytest.approx(coverage(7, 1), abs=0.01)


def test_one_value_has_no_interval() -> None:
    assert median_interval(np.array([1.0])) is None


def test_reduction_is_that_of_the_medians_and_its_interval_that_of_the_pairs() -> None:
    best, baseline = np.array([6.0, 5.0, 9.0]), np.array([10.0, 10.0, 12.0])
    its = Comparison((1, 2, 3), best, baseline)
    assert its.reduction == pytest.approx(40.0)  # 6 against 10
    interval = its.reduction_interval
    assert interval is not None
    assert (interval.low, interval.high) == pytest.approx((25.0, 50.0))
    assert interval.low <= its.reduction <= interval.high


def test_reduction_does_not_depend_on_the_unit() -> None:
    best, baseline = np.array([0.06, 0.05]), np.array([0.10, 0.11])
    in_s, in_ms = (Comparison((1, 2), best * k, baseline * k).reduction for k in (1.0, 1e3))
    assert in_s == pytest.approx(in_ms)


@pytest.mark.parametrize("baseline", [[0.0, 0.0, 0.0], [-1.0, -1.0, -2.0], [math.inf] * 3])
def test_no_percentage_where_it_would_mean_nothing(baseline: list[float]) -> None:
    its = Comparison((1, 2, 3), np.array([1.0, 2.0, 3.0]), np.array(baseline))
    assert its.reduction is None
    assert its.reduction_interval is None


def test_a_failed_run_counts_as_the_worst() -> None:
    its = Comparison((1, 2, 3), np.array([1.0, math.inf, 2.0]), np.array([4.0, 4.0, 4.0]))
    assert its.median_best == 2.0
    assert its.reduction_interval is None
