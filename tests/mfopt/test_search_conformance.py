"""What every search must do, whoever proposes the designs."""

from collections.abc import Callable

import numpy as np
import pytest

from mfopt.arrays import Array
from mfopt.assisted import AssistedCmaEs
from mfopt.cmaes import CmaEs
from mfopt.problem import Constraint, Problem, Variable
from mfopt.search import Rung, Search, Stage
from surrogates.autoregressive import AutoregressiveGp

Make = Callable[[Problem], Search]


def planned(problem: Problem) -> Search:
    return CmaEs(problem, [Stage("coarse", 3, 6), Stage("fine", 2, 6)], seed=1)


def assisted(problem: Problem) -> Search:
    rungs = [Rung("coarse", 0.2), Rung("fine", 1.0)]
    return AssistedCmaEs(problem, rungs, AutoregressiveGp(), budget=14.0, seed=1)


SEARCHES = pytest.mark.parametrize("make", [planned, assisted])


def problem(constraint: Constraint | None = None) -> Problem:
    variables = tuple(Variable(f"x{i}", -5.0, 5.0) for i in range(3))
    return Problem(variables, np.full(3, 2.0), constraint)


def value(x: Array, level: str) -> float:
    """A bowl; failed runs in a corner; the coarse level is off by a little."""
    if x[0] > 3.0:
        return np.inf
    return float(((x - 1.0 - 0.1 * (level == "coarse")) ** 2).sum())


def drive(search: Search, workers: int, order_seed: int = 0) -> list[tuple[int, str, bytes]]:
    """Run with so many runs out at a time, which end in an order by chance."""
    rng = np.random.default_rng(order_seed)
    asked, out = [], []
    while True:
        if search.should_stop() is None:
            out += (new := search.ask(workers - len(out)))
            asked += [(c.index, c.level, c.x.tobytes()) for c in new]
        if not out:
            return asked
        ended = out.pop(int(rng.integers(len(out))))
        search.tell([ended], [value(ended.x, ended.level)], np.zeros((1, 2)))


@SEARCHES
@pytest.mark.parametrize("workers", [1, 3])
def test_the_same_order_gives_the_same_search(make: Make, workers: int) -> None:
    first, again = (drive(make(problem()), workers, order_seed=5) for _ in range(2))
    assert first == again
    assert [index for index, _, _ in first] == list(range(len(first)))
    assert {level for _, level, _ in first} == {"coarse", "fine"}


@SEARCHES
def test_it_stops_with_a_reason_and_a_recommendation(make: Make) -> None:
    search = make(problem())
    assert search.recommended() is None
    assert search.should_stop() is None
    assert sum(n for _, n in search.work_left) > 0
    drive(search, 2)
    assert search.should_stop()
    assert search.ask(3) == []
    assert not search.work_left
    best = search.recommended()
    assert best is not None
    assert value(best, "fine") < 0.5 * value(problem().baseline, "fine")


@SEARCHES
def test_impossible_designs_are_never_proposed(make: Make) -> None:
    def constraint(x: Array) -> str | None:
        return "x1 above 2.5" if x[1] > 2.5 else None

    designs = [np.frombuffer(x) for _, _, x in drive(make(problem(constraint)), 2)]
    assert max(x[1] for x in designs) <= 2.5


@SEARCHES
def test_it_survives_that_every_run_fails(make: Make) -> None:
    search = make(problem())
    while search.should_stop() is None:
        candidates = search.ask()
        search.tell(candidates, [np.inf] * len(candidates))
    assert search.should_stop()
