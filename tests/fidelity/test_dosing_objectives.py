import math

import numpy as np
import pytest

from fidelity.scenes.dosing.objectives import (
    Wanted,
    Weights,
    criteria,
    dispersion,
    filling_time,
    paper_dispersion,
    weights_of,
)
from mfopt.arrays import AnyArray
from mfopt.errors import ConfigError
from mfopt.records.objective import judged, missed
from mfopt.records.outcome import Outcome
from mfopt.settings import checked

X = np.zeros(1)


def raw(times: list[float], cup: int = 0, hopper: int = 0) -> dict[str, AnyArray]:
    return {
        "passage_times": np.array(times),
        "grains": np.asarray(len(times) + cup + hopper),
        "left_in_cup": np.asarray(cup),
        "left_in_hopper": np.asarray(hopper),
        "duration": np.asarray(1.2),
    }


def test_the_paper_leaves_the_last_twenty_grains_out() -> None:
    # 0, 1, 2, 3 s have the standard deviation sqrt(5)/2; twenty stragglers must not matter.
    times = [0.0, 1.0, 2.0, 3.0]
    for straggler in (10.0, 1000.0):
        terms = paper_dispersion(raw([*times, *[straggler] * 20]))
        assert terms["dispersion"] == pytest.approx(math.sqrt(5.0) / 2.0, rel=1e-14)


def test_the_paper_prices_each_grain_left() -> None:
    terms = paper_dispersion(raw([0.1] * 90, cup=7, hopper=3))
    assert terms["left in cup"] == pytest.approx(0.35, rel=1e-14)
    assert terms["left in hopper"] == pytest.approx(1.5, rel=1e-14)


def test_shares_are_the_papers_counts_at_the_reference_number_of_grains() -> None:
    times = list(np.random.default_rng(1).normal(0.4, 0.1, 4590))
    run = raw(times, cup=6, hopper=4)
    assert dispersion(run) == pytest.approx(paper_dispersion(run), rel=1e-12)


def test_objectives_mean_the_same_at_every_number_of_grains() -> None:
    # One flow, resolved by few and by many grains: a hundredth of the mass stays behind.
    quantile = np.polynomial.Polynomial([0.2, 0.3, 0.0, 0.1])

    def sampled(grains: int) -> dict[str, AnyArray]:
        left = grains // 100
        passed = grains - left
        return raw(list(quantile((np.arange(passed) + 0.5) / passed)), cup=left)

    weights = Weights(filling_time_limit_s=0.2)
    few, many = (dispersion(sampled(n), weights) for n in (300, 18_300))
    assert few == pytest.approx(many, rel=0.02)  # a span of 300 quantiles is 1 % shorter
    paper = [paper_dispersion(sampled(n))["left in cup"] for n in (300, 18_300)]
    assert paper[1] > 50.0 * paper[0]


def test_a_part_of_a_grain_is_left_out_of_a_coarse_portion() -> None:
    # 300 of 4600 grains: the last 20 are 1.3 of them; the last but one weighs 0.7 of a grain.
    times = np.sort(np.random.default_rng(2).uniform(0.0, 1.0, 300))
    kept, part = times[:-2], 2.0 - 20.0 * 300.0 / 4600.0
    mean = (kept.sum() + part * times[-2]) / (298.0 + part)
    squares = ((kept - mean) ** 2).sum() + part * (times[-2] - mean) ** 2
    expected = math.sqrt(squares / (298.0 + part))
    assert dispersion(raw(list(times)))["dispersion"] == pytest.approx(expected, rel=1e-12)


def test_a_filling_time_within_the_limit_costs_nothing() -> None:
    within, above = raw([0.1, 0.2, 0.4]), raw([0.1, 0.2, 0.5])
    weights = Weights(filling_time_limit_s=0.33, filling_time_weight=2.0)
    assert dispersion(within, weights)["over time limit"] == 0.0
    assert dispersion(above, weights)["over time limit"] == pytest.approx(0.14, rel=1e-12)
    assert dispersion(above)["over time limit"] == 0.0  # no limit is set


def test_with_too_few_grains_the_duration_stands_in() -> None:
    assert paper_dispersion(raw([0.1] * 22))["dispersion"] == 1.2
    assert dispersion(raw([], cup=40))["dispersion"] == 1.2
    assert filling_time(raw([0.1, 0.2]))["filling time"] == 1.2


def test_dispersion_is_invariant_to_a_shift_of_the_clock() -> None:
    times = np.random.default_rng(1).uniform(0.3, 0.8, 200)
    a, b = (dispersion(raw(list(times + shift)))["dispersion"] for shift in (0.0, 5.0))
    assert a == pytest.approx(b, rel=1e-12)


def test_quantities_are_what_an_engineer_asks_for() -> None:
    run = Outcome(X, "l", 1, "finished", raw=raw([0.1] * 60 + [0.4] * 39, cup=1))
    asked = criteria().quantities_of(run)
    assert list(asked) == ["dispersion", "filling time", "mass left"]
    assert asked["filling time"] == pytest.approx(0.3)
    assert asked["mass left"] == pytest.approx(0.01)
    other = Outcome(X, "l", 1, "finished", raw={"f": np.asarray(1.0)})
    assert criteria().quantities_of(other) == {}


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"f": np.asarray(1.0)}, "lacks 'grains'"),
        ({**raw([0.1] * 40), "grains": np.asarray(0)}, "cannot be computed"),
    ],
)
def test_a_run_without_its_objective_has_crashed_and_says_why(
    given: dict[str, AnyArray], why: str
) -> None:
    objective = criteria().objective("dispersion")
    outcome, f = judged(objective, Outcome(X, "l", 1, "finished", raw=given))
    assert (f, outcome.status) == (math.inf, "crashed")
    assert why in (outcome.why or "")
    assert missed(objective, [outcome]).tolist() == [[0.0, 0.0, 0.0]]


def test_unknown_objective_names_the_known() -> None:
    with pytest.raises(ConfigError, match="filling_time"):
        criteria().objective("fill")


@pytest.mark.parametrize(
    "wrong",
    [{"reference_grains": 0}, {"filling_time_limit_ms": 0.0}, {"filling_time_weight": -1.0}],
)
def test_settings_out_of_range_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        checked(Wanted, wrong, where="study")


def test_the_limit_of_a_study_is_in_milliseconds() -> None:
    assert weights_of(Wanted(filling_time_limit_ms=330.0)).filling_time_limit_s == 0.33
