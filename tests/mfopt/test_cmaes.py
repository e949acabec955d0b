from collections.abc import Callable

import cma
import numpy as np
import pytest

from mfopt.arrays import Array
from mfopt.errors import ConfigError, SimulationError
from mfopt.records.evaluation import Generation
from mfopt.records.problem import Constraint, Problem, Variable
from mfopt.search.cmaes import CmaEs
from mfopt.search.search import Stage

Function = Callable[[Array], float]


def problem(constraint: Constraint | None = None, d: int = 4) -> Problem:
    variables = tuple(Variable(f"x{i}", -5.0, 5.0) for i in range(d))
    return Problem(variables, np.full(d, 3.0), constraint)


def sphere(x: Array) -> float:
    return float(np.sum(x**2))


def drive(search: CmaEs, f: Function) -> tuple[list[Array], list[Generation]]:
    designs, generations = [], []
    while search.should_stop() is None:
        generations.append(search.generation)
        candidates = search.ask()
        designs += [c.x for c in candidates]
        search.tell(candidates, [f(c.x) for c in candidates])
    return designs, generations


def test_finds_the_minimum_of_the_sphere() -> None:
    designs, _ = drive(CmaEs(problem(), [Stage("l", 60, 8)], seed=1), sphere)
    # It is converged at steps of TOLERANCE_X of a width of 10, here 4 x 0.01**2.
    assert min(map(sphere, designs)) < 4e-4


def test_without_restarts_it_is_pycma() -> None:
    # Same draws, same told values: the designs must be those of cma itself, bit for bit.
    stage = Stage("l", 12, 8, sigma=0.2)
    designs, _ = drive(CmaEs(problem(), [stage], seed=5), sphere)
    rng = np.random.default_rng(5)
    p = problem()
    options = {
        "bounds": [0.0, 1.0], "popsize": 8, "seed": np.nan, "verbose": -9, "verb_log": 0,
        "randn": lambda *shape: rng.standard_normal(shape),
    }  # fmt: skip
    es = cma.CMAEvolutionStrategy(p.to_z(p.baseline), 0.2, options)
    expected = []
    for generation in range(12):
        opening = [p.to_z(p.baseline)] if generation == 0 else []
        z = opening + es.ask(8 - len(opening))
        es.tell(z, [sphere(p.to_x(row)) for row in z])
        expected += [p.to_x(row) for row in z]
    np.testing.assert_array_equal(designs, expected)


def test_same_seed_same_search_and_another_seed_another() -> None:
    runs = [drive(CmaEs(problem(), [Stage("l", 9, 6)], seed=s), sphere)[0] for s in (2, 2, 3)]
    np.testing.assert_array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0], runs[2])


def test_level_change_restarts_from_the_best_design() -> None:
    stages = [Stage("coarse", 6, 6), Stage("fine", 4, 8, sigma=0.1)]
    designs, generations = drive(CmaEs(problem(), stages, seed=1), sphere)
    assert [g.level for g in generations] == ["coarse"] * 6 + ["fine"] * 4
    assert [g.restart for g in generations] == [0] * 6 + [1] * 4
    assert generations[6].why == "level change to fine"
    best_of_coarse = min(designs[:36], key=sphere)
    np.testing.assert_allclose(designs[36], best_of_coarse, rtol=1e-15, atol=1e-15)


def test_convergence_restarts_with_a_reason() -> None:
    _, generations = drive(CmaEs(problem(), [Stage("l", 150, 6)], seed=1), sphere)
    restarts = [g for g in generations if g.why.startswith("converged")]
    assert restarts
    assert restarts[0].sigma == 0.2


def test_impossible_designs_are_never_proposed() -> None:
    def constraint(x: Array) -> str | None:
        return "x0 below x1" if x[0] < x[1] - 0.5 else None

    designs, _ = drive(CmaEs(problem(constraint), [Stage("l", 20, 8)], seed=4), sphere)
    assert all(constraint(x) is None for x in designs)


def test_nothing_possible_is_an_error_with_the_reason() -> None:
    def only_the_start(x: Array) -> str | None:
        return None if np.allclose(x, 3.0) else "radius 9 too large"

    search = CmaEs(problem(only_the_start), [Stage("l", 20, 8)], seed=4)
    with pytest.raises(SimulationError, match="radius 9 too large"):
        search.ask()


def test_failed_runs_do_not_stop_the_search() -> None:
    def failing(x: Array) -> float:
        return np.inf if x[0] > 3.5 else sphere(x)

    designs, _ = drive(CmaEs(problem(), [Stage("l", 40, 8)], seed=1), failing)
    assert min(map(sphere, designs)) < 0.1
    drive(CmaEs(problem(), [Stage("l", 12, 8)], seed=1), lambda x: np.inf)


def test_exchange_leads_out_of_the_backward_minimum() -> None:
    # Two basins mirrored at x0 = x1; the one where x0 > x1 is worse, and a ridge divides them.
    def two_basins(x: Array) -> float:
        backward = x[0] > x[1]
        centre = np.array([2.0, -2.0]) if backward else np.array([-2.0, 2.0])
        return float(np.sum((x[:2] - centre) ** 2) * 0.1 + np.sum(x[2:] ** 2) + 1.0 * backward)

    start = Problem(problem().variables, np.array([2.0, -1.0, 0.0, 0.0]))
    stages = [Stage("l", 40, 8, sigma=0.05)]
    ends = []
    for exchange in (None, ("x0", "x1")):
        designs, generations = drive(CmaEs(start, stages, seed=3, exchange=exchange), two_basins)
        ends.append(min(map(two_basins, designs)))
        reasons = [g.why for g in generations]
        assert ("x0 and x1 exchanged" in reasons) == (exchange is not None)
    assert ends[0] > 1.0
    assert ends[1] < 0.5


def test_seeds_rotate_by_generation() -> None:
    search = CmaEs(problem(), [Stage("l", 5, 6, seeds=2)], seed=1, first_seed=10)
    seen = []
    while search.should_stop() is None:
        candidates = search.ask()
        seen.append({c.seed for c in candidates})
        search.tell(candidates, [sphere(c.x) for c in candidates])
    assert seen == [{10}, {11}, {10}, {11}, {10}]


def test_unknown_exchange_variable_is_named() -> None:
    with pytest.raises(ConfigError, match="'y9'"):
        CmaEs(problem(), [Stage("l", 5, 6)], seed=1, exchange=("x0", "y9"))
