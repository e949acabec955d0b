"""What runs before and after a search."""

import numpy as np
import pytest

from mfopt.arrays import distinct
from mfopt.campaign.phases import (
    CONFIRM_SEED,
    FINALIST_SEED,
    Finals,
    Starts,
    by_mean,
    finalists,
)
from mfopt.records.evaluation import Evaluation
from mfopt.records.outcome import Outcome

A, B, C = (np.full(2, value) for value in (0.1, 0.2, 0.3))


def evaluations(values: dict[str, list[float]]) -> list[Evaluation]:
    starts = Starts({"a": A, "b": B, "c": C}, "coarse", seeds=2)
    found = starts.candidates(0)
    told = [v for its in values.values() for v in its]
    return [
        Evaluation(c, Outcome(c.x, c.level, c.seed, "finished"), v)
        for c, v in zip(found, told, strict=True)
    ]


def test_every_start_is_run_on_every_seed_of_the_search() -> None:
    found = Starts({"a": A, "b": B}, "coarse", seeds=2).candidates(0)
    assert [(c.index, c.x[0], c.seed) for c in found] == [
        (0, 0.1, 1), (1, 0.1, 2), (2, 0.2, 1), (3, 0.2, 2),
    ]  # fmt: skip
    assert {(c.level, c.purpose, c.generation) for c in found} == {("coarse", "start", 0)}


def test_the_lowest_mean_wins_and_not_the_luckiest_run() -> None:
    told = {"a": [0.1, 0.8], "b": [0.4, 0.4], "c": [0.5, 0.5]}
    assert [x[0] for x in by_mean(evaluations(told))] == [0.2, 0.1, 0.3]


def test_the_sum_of_huge_values_is_no_failure() -> None:
    told = {"a": [1.5e308, 1.5e308], "b": [1e308, 1e308], "c": [1.0, np.inf]}
    assert [x[0] for x in by_mean(evaluations(told))] == [0.2, 0.1]


def test_a_design_that_fails_once_does_not_win() -> None:
    told = {"a": [0.0, np.inf], "b": [0.4, 0.4], "c": [np.inf, np.inf]}
    assert [x[0] for x in by_mean(evaluations(told))] == [0.2]


@pytest.mark.parametrize("count", [0, 3])
def test_nothing_wins_where_all_failed_or_nothing_ran(count: int) -> None:
    told = evaluations({name: [np.inf, np.inf] for name in "abc"})
    assert by_mean(told[: 2 * count]) == []


def test_finalists_are_run_on_seeds_of_their_own() -> None:
    found = finalists([A, B], "fine", 2, 2, 7)
    assert [c.index for c in found] == [7, 8, 9, 10]
    assert {(c.level, c.purpose) for c in found} == {("fine", "finalist")}
    assert {c.seed for c in found} == {FINALIST_SEED + 2, FINALIST_SEED + 3}
    assert CONFIRM_SEED not in {c.seed for c in found}


def test_every_round_costs_about_the_same() -> None:
    assert Finals(8, seeds=1).runs(8) == 8 * 1 + 4 * 2 + 2 * 4
    assert Finals(5, seeds=3).runs(6) == 6 * 3 + 3 * 6
    assert Finals(1).runs(1) == 0


def test_a_design_is_a_rival_once() -> None:
    assert len(distinct([A, A.copy(), B])) == 2
