import numpy as np
import pytest

from fidelity.programs.function import FunctionLevel
from mfopt.errors import ConfigError
from mfopt.records.level import Ladder
from mfopt.search.search import CHEAPEST, Rung, Stage, affordable, check_rungs, rungs

X = np.array([0.5])


def ladder(**works: float) -> Ladder:
    return Ladder(tuple(FunctionLevel(n, lambda x, seed: 0.0, w) for n, w in works.items()))


def test_costs_are_in_runs_of_the_target_and_at_least_a_512th() -> None:
    assert rungs(ladder(a=1.0, b=3.0, c=12.0), X) == (
        Rung("a", 1 / 12), Rung("b", 0.25), Rung("c", 1.0),
    )  # fmt: skip
    assert rungs(ladder(a=1.0, b=1e6), X)[0].cost == CHEAPEST == 1 / 512


@pytest.mark.parametrize(
    "works", [{"a": 10, "b": 1}, {"a": 1, "b": 5, "c": 3}, {"a": 5, "b": 2, "c": 9}]
)
def test_a_level_dearer_than_the_one_after_it_is_refused(works: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match=r"a run at level '\w' costs .*, more than one at '\w'"):
        rungs(ladder(**works), X)


def test_equal_costs_are_a_ladder_too() -> None:
    check_rungs([Rung("a", 1.0), Rung("b", 1.0)])


@pytest.mark.parametrize("budget", [0.9, float("nan"), "10", True, 2e6])
def test_a_budget_must_be_a_number_of_runs_that_can_be_made(budget: float) -> None:
    with pytest.raises(ConfigError, match=r"^budget = "):
        affordable(budget, [Rung("a", 1.0)])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"generations": 0}, "stage on 'l': generations = 0 must be at least 1"),
        ({"generations": 10**9}, "generations = 1000000000 must be at most"),
        ({"population_size": 1}, "population_size = 1 must be at least 2"),
        ({"population_size": 2.0}, r"population_size = 2\.0 must be a whole number"),
        ({"seeds": True}, "seeds = True must be a whole number"),
        ({"sigma": float("nan")}, "sigma = nan must be a finite number"),
        ({"sigma": 1.5}, r"sigma = 1\.5 must be at most 1; lower it \(a step in the unit cube"),
        ({"reevaluate": 3}, "reevaluate = 3 is none of none, ranks, elite"),
        ({"level": ""}, "name of a level"),
    ],
)
def test_wrong_stages_are_named(change: dict[str, object], words: str) -> None:
    whole: dict[str, object] = {"level": "l", "generations": 1, "population_size": 4, **change}
    with pytest.raises(ConfigError, match=words):
        Stage(**whole)  # type: ignore[arg-type]
