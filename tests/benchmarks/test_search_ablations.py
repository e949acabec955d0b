"""Each ablation lacks its part, and nothing else keeps it from searching."""

from collections import Counter
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from benchmarks.search.peers.ablations import (
    ABLATIONS,
    Finalists,
    MovesDown,
    NoPrescreening,
    NoProposal,
    NoTransfer,
    PlannedLevels,
    PrescreeningUnderNoise,
    WholeUnderNoise,
)
from mfopt.arrays import Array
from mfopt.records.evaluation import Candidate
from mfopt.records.problem import Problem, Variable
from mfopt.search.assisted import AssistedCmaEs
from mfopt.search.search import Rung
from surrogates.autoregressive import AutoregressiveGp

D, SIZE = 4, 8
OPTIMUM = np.array([0.3, 0.6, 0.45, 0.7])
PROBLEM = Problem(tuple(Variable(f"x{i}", 0.0, 1.0) for i in range(D)), np.full(D, 0.5))
ONE, TWO = (Rung("0", 1.0),), (Rung("0", 1.0), Rung("1", 8.0))


def bowl(x: Array) -> float:
    return float(((x - OPTIMUM) ** 2) @ np.array([1.0, 3.0, 9.0, 27.0]))


@cache
def searched(
    kind: type[AssistedCmaEs], rungs: tuple[Rung, ...], budget: float, noise: float = 0.0
) -> tuple[AssistedCmaEs, list[Candidate]]:
    """The search at its end, and all that it ran."""
    search = kind(
        PROBLEM, rungs, AutoregressiveGp(), budget=budget, seed=1, population_size=SIZE
    )  # fmt: skip
    ran: list[Candidate] = []
    rng = np.random.default_rng(0)
    while search.should_stop() is None:
        asked = search.ask()
        ran += asked
        search.tell(asked, [bowl(c.x) + noise * rng.standard_normal() for c in asked])
    return search, ran


def gap(search: AssistedCmaEs) -> float:
    x = search.recommended()
    assert x is not None
    return bowl(x)


@pytest.mark.parametrize("kind", ABLATIONS.values())
def test_it_still_finds_better_designs(kind: type[AssistedCmaEs]) -> None:
    search, _ = searched(kind, TWO, 60.0)
    assert gap(search) < 0.3 * bowl(np.full(D, 0.5))


def test_without_prescreening_whole_generations_are_run() -> None:
    def least(kind: type[AssistedCmaEs]) -> int:
        runs = Counter(c.generation for c in searched(kind, ONE, 40.0)[1])
        return min(n for generation, n in runs.items() if generation < max(runs))

    assert least(NoPrescreening) == SIZE
    assert least(AssistedCmaEs) < SIZE


@pytest.mark.parametrize(
    ("kind", "noise", "whole"),
    [
        (AssistedCmaEs, 0.0, False),
        (AssistedCmaEs, 3.0, True),  # differences at the start are of about 1
        (PrescreeningUnderNoise, 3.0, False),
        (WholeUnderNoise, 0.0, False),
        (WholeUnderNoise, 0.01, True),
    ],
)
def test_where_runs_scatter_whole_generations_are_run(
    kind: type[AssistedCmaEs], noise: float, whole: bool
) -> None:
    runs = Counter(c.generation for c in searched(kind, ONE, 60.0, noise)[1])
    least = min(n for generation, n in runs.items() if 2 < generation < max(runs))
    assert (least >= SIZE) is whole


def test_without_proposals_a_bowl_takes_longer() -> None:
    with_them, without = (searched(kind, ONE, 60.0)[0] for kind in (AssistedCmaEs, NoProposal))
    assert gap(with_them) < 0.5 * gap(without)


def test_with_planned_levels_nothing_is_validated_ahead() -> None:
    def runs_before_the_next_level(kind: type[AssistedCmaEs]) -> int:
        return [c.level for c in searched(kind, TWO, 120.0)[1]].index("1")

    assert runs_before_the_next_level(PlannedLevels) >= 60
    assert runs_before_the_next_level(AssistedCmaEs) < 60


def test_without_transfer_the_surrogate_knows_its_own_level() -> None:
    def known(kind: type[AssistedCmaEs]) -> tuple[int, ...]:
        belief = searched(kind, TWO, 120.0)[0]._belief
        assert belief is not None
        return belief.posterior.hyperparameters.levels

    assert known(NoTransfer) == (1,)
    assert known(AssistedCmaEs) == (0, 1)


def test_levels_that_rank_alike_are_gone_back_to() -> None:
    def goes_down(kind: type[AssistedCmaEs]) -> bool:
        search, levels = kind(PROBLEM, TWO, AutoregressiveGp(), budget=200.0, seed=1), ["0"]
        while search.should_stop() is None:
            asked = search.ask()
            search.tell(asked, [bowl(c.x) for c in asked])
            levels.append(search.generation.level)
        return ("1", "0") in pairwise(levels)

    assert goes_down(MovesDown)
    assert not goes_down(AssistedCmaEs)


def test_the_last_runs_are_of_few_designs() -> None:
    def distinct(kind: type[AssistedCmaEs]) -> int:
        return len({tuple(c.x) for c in searched(kind, ONE, 60.0)[1][-Finalists.LAST :]})

    assert distinct(Finalists) <= Finalists.MOST < distinct(AssistedCmaEs)
