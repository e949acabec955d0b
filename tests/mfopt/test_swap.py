import numpy as np
import pytest

from mfopt.errors import ConfigError
from mfopt.records.problem import Problem, Variable
from mfopt.search.archive import Archive
from mfopt.search.swap import Exchange, check_pair, swapped, wrong_way

VARIABLES = (Variable("a", 0.0, 1.0), Variable("b", 0.0, 2.0), Variable("c", 0.0, 1.0))
PROBLEM = Problem(VARIABLES, np.full(3, 0.5))
WRONG = PROBLEM.to_z(np.array([0.2, 1.7, 0.3]))  # b above a
EXCHANGED = PROBLEM.to_z(np.array([1.0, 0.2, 0.3]))


def runs(*values: tuple[np.ndarray, float]) -> Archive:
    archive = Archive.empty(3)
    for z, value in values:
        archive = archive.added(z, 0, 1, value, np.empty(0))
    return archive


def test_exchange_moves_both_values_into_their_bounds() -> None:
    assert wrong_way(PROBLEM, ("b", "a"), np.array([0.2, 1.7, 0.3]))
    turned = swapped(PROBLEM, ("b", "a"), np.array([0.2, 1.7, 0.3]))
    np.testing.assert_array_equal(turned, [1.0, 0.2, 0.3])


def test_an_impossible_exchange_is_none() -> None:
    problem = Problem(VARIABLES, PROBLEM.baseline, lambda x: "no" if x[0] > 0.9 else None)
    assert swapped(problem, ("b", "a"), np.array([0.2, 1.7, 0.3])) is None


def test_the_attempt_is_the_design_exchanged() -> None:
    attempt = Exchange(PROBLEM, ("b", "a")).attempt(WRONG)
    assert attempt is not None
    np.testing.assert_allclose(attempt, EXCHANGED)


def test_one_try_a_level() -> None:
    exchange = Exchange(PROBLEM, ("b", "a"))
    assert exchange.attempt(WRONG) is not None
    assert exchange.attempt(WRONG) is None
    exchange.new_level()
    assert exchange.attempt(WRONG) is not None


def test_a_design_the_right_way_round_is_left_alone() -> None:
    exchange = Exchange(PROBLEM, ("b", "a"))
    assert exchange.attempt(EXCHANGED) is None
    assert exchange.attempt(WRONG) is not None  # it did not count as a try


def test_no_pair_no_try() -> None:
    assert Exchange(PROBLEM, None).attempt(WRONG) is None


def test_an_impossible_exchange_is_not_tried() -> None:
    problem = Problem(VARIABLES, PROBLEM.baseline, lambda x: "no" if x[0] > 0.9 else None)
    assert Exchange(problem, ("b", "a")).attempt(WRONG) is None


@pytest.mark.parametrize(("its", "pays"), [(1.0, True), (3.0, False), (np.inf, False)])
def test_success_is_the_best_run_of_the_level(its: float, pays: bool) -> None:
    exchange = Exchange(PROBLEM, ("b", "a"))
    attempt = exchange.attempt(WRONG)
    assert attempt is not None
    found = exchange.success(runs((WRONG, 2.0), (attempt, its)), 0)
    assert (found is not None) == pays


def test_no_success_before_its_run_is_in() -> None:
    exchange = Exchange(PROBLEM, ("b", "a"))
    exchange.attempt(WRONG)
    assert exchange.success(runs((WRONG, 2.0)), 0) is None


def test_a_variable_that_is_not_free_is_named() -> None:
    with pytest.raises(ConfigError, match="'z', which is not free"):
        check_pair(PROBLEM, ("a", "z"))
    with pytest.raises(ConfigError, match="'z', which is not free"):
        Exchange(PROBLEM, ("a", "z"))
