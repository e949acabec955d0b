import numpy as np
import pytest

from mfopt.errors import ConfigError
from mfopt.problem import Problem, Variable
from mfopt.swap import check_pair, swapped, wrong_way

PROBLEM = Problem(
    (Variable("a", 0.0, 1.0), Variable("b", 0.0, 2.0), Variable("c", 0.0, 1.0)), np.full(3, 0.5)
)


def test_exchange_moves_both_values_into_their_bounds() -> None:
    assert wrong_way(PROBLEM, ("b", "a"), np.array([0.2, 1.7, 0.3]))
    turned = swapped(PROBLEM, ("b", "a"), np.array([0.2, 1.7, 0.3]))
    np.testing.assert_array_equal(turned, [1.0, 0.2, 0.3])


def test_an_impossible_exchange_is_none() -> None:
    problem = Problem(PROBLEM.variables, PROBLEM.baseline, lambda x: "no" if x[0] > 0.9 else None)
    assert swapped(problem, ("b", "a"), np.array([0.2, 1.7, 0.3])) is None


def test_a_variable_that_is_not_free_is_named() -> None:
    with pytest.raises(ConfigError, match="'z', which is not free"):
        check_pair(PROBLEM, ("a", "z"))
