"""What every search must do, whoever proposes the designs."""

from collections.abc import Callable

import numpy as np
import pytest

from mfopt.arrays import Array
from mfopt.errors import ConfigError
from mfopt.records.problem import Constraint, Problem, Variable
from mfopt.search.assisted import AssistedCmaEs
from mfopt.search.cmaes import CmaEs
from mfopt.search.search import Rung, Search, Stage
from surrogates.autoregressive import AutoregressiveGp

Make = Callable[..., Search]


def planned(problem: Problem, size: int = 6, sigma: float = 0.2, seed: int = 1) -> Search:
    stages = [Stage("coarse", 3, size, sigma), Stage("fine", 2, size, sigma)]
    return CmaEs(problem, stages, seed=seed)


def assisted(
    problem: Problem, size: int | None = None, sigma: float = 0.2, seed: int = 1
) -> Search:
    rungs = [Rung("coarse", 0.2), Rung("fine", 1.0)]
    return AssistedCmaEs(
        problem, rungs, AutoregressiveGp(), budget=9.0, seed=seed, population_size=size,
        sigma=sigma,
    )  # fmt: skip


SEARCHES = pytest.mark.parametrize("make", [planned, assisted])


def problem(constraint: Constraint | None = None, d: int = 3) -> Problem:
    variables = tuple(Variable(f"x{i}", -5.0, 5.0) for i in range(d))
    return Problem(variables, np.full(d, 2.0), constraint)


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
def test_the_start_comes_back_bit_for_bit(make: Make) -> None:
    start = np.full(2, 0.45)
    variables = tuple(Variable(name, 0.1, 0.9) for name in "ab")
    at_start = Problem(variables, start)
    assert (at_start.to_x(at_start.to_z(start)) != start).all()  # by rounding
    search = make(at_start)
    while search.should_stop() is None:
        asked = search.ask()
        search.tell(asked, [float(((c.x - start) ** 2).sum()) for c in asked])
    (best, *others) = search.finalists(3)
    np.testing.assert_array_equal(search.recommended(), start)
    np.testing.assert_array_equal(best, start)
    assert all(np.abs(x - start).max() > 1e-12 for x in others)


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


@pytest.mark.parametrize(
    ("make", "d", "size"),
    [
        *((planned, d, size) for d in (1, 2, 7) for size in (2, 3, 4, 5)),
        *((assisted, d, size) for d, size in ((1, 2), (1, 3), (2, 2), (2, 5), (7, 2), (7, 4))),
    ],
)
def test_small_populations_work_in_any_dimension(make: Make, d: int, size: int) -> None:
    search = make(problem(d=d), size)
    drive(search, 2)
    best = search.recommended()
    assert best is not None
    assert value(best, "fine") <= value(problem(d=d).baseline, "fine")


@SEARCHES
@pytest.mark.parametrize("sigma", [0.3, 1.0])
def test_one_variable_works_from_wide_steps(make: Make, sigma: float) -> None:
    for seed in range(2 if make is assisted else 20):
        search = make(problem(d=1), 4, sigma, seed)
        drive(search, 1)
        best = search.recommended()
        assert best is not None
        assert value(best, "fine") < value(problem(d=1).baseline, "fine")


@SEARCHES
def test_an_impossible_start_is_refused_before_it_is_run(make: Make) -> None:
    with pytest.raises(ConfigError, match="is impossible: x0 above 1"):
        make(problem(lambda x: "x0 above 1" if x[0] > 1.0 else None))


@SEARCHES
@pytest.mark.parametrize(("name", "wrong"), [("size", 1), ("sigma", 0.0), ("seed", -1)])
def test_wrong_arguments_are_named(make: Make, name: str, wrong: float) -> None:
    with pytest.raises(ConfigError, match=f"{name} = {wrong:g} must be at least"):
        make(problem(), **{name: wrong})


@SEARCHES
def test_designs_at_the_bounds_stay_inside_bit_for_bit(make: Make) -> None:
    variables = tuple(Variable(f"x{i}", -3.0, -0.9) for i in range(4))
    its = Problem(variables, np.full(4, -1.0))
    search = make(its)
    while search.should_stop() is None:
        candidates = search.ask()
        assert all((c.x >= its.lower).all() and (c.x <= its.upper).all() for c in candidates)
        search.tell(candidates, [-float(c.x.sum()) for c in candidates])
    best = search.recommended()
    assert best is not None
    assert (best <= its.upper).all()


@SEARCHES
@pytest.mark.parametrize(
    "odd", [[1e200], [-1e200, np.nan], [1.7e308, -1.7e308], [5e-324, 0.0], [1e30, -np.inf]]
)
def test_values_of_any_magnitude_stop_nothing(make: Make, odd: list[float]) -> None:
    search = make(problem())
    count = 0
    while search.should_stop() is None:
        candidates = search.ask()
        values = []
        for c in candidates:
            count += 1
            values.append(odd[count % len(odd)] if count % 3 == 0 else value(c.x, c.level))
        search.tell(candidates, values)
        if search.insight is not None:
            assert np.isfinite([search.insight.mean, search.insight.deviation]).all()
    assert search.recommended() is not None
