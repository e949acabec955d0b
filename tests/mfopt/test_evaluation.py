"""What a search believes, as an interval."""

import math

import pytest

from mfopt.records.evaluation import Insight


def insight(mean: float, deviation: float, *, positive: bool) -> Insight:
    return Insight(1, 0.9, 4, "fine", (0.0,), mean, deviation, positive=positive)


@pytest.mark.parametrize("deviation", [1e-3, 0.09, 1.0, 1e200])
def test_an_interval_of_a_positive_quantity_is_positive_and_holds_its_estimate(
    deviation: float,
) -> None:
    low, high = insight(0.13, deviation, positive=True).interval
    assert 0.0 <= low < 0.13 < high < math.inf


def test_a_small_deviation_gives_the_same_interval_on_both_scales() -> None:
    assert insight(0.13, 1e-4, positive=True).interval == pytest.approx(
        insight(0.13, 1e-4, positive=False).interval, rel=1e-5
    )


def test_a_quantity_of_either_sign_has_its_estimate_in_the_middle() -> None:
    low, high = insight(0.1, 0.1, positive=False).interval
    assert low < 0.0
    assert (low + high) / 2.0 == pytest.approx(0.1)
