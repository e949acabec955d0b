import numpy as np
import pytest

from mfopt.errors import ConfigError
from mfopt.problem import Problem, Variable


def test_unit_cube_and_back_is_the_identity() -> None:
    problem = Problem((Variable("a", -2.0, 3.0), Variable("b", 10.0, 11.0)), np.array([0.0, 10.5]))
    x = np.random.default_rng(0).uniform(problem.lower, problem.upper, (50, 2))
    np.testing.assert_allclose(problem.to_x(problem.to_z(x)), x, rtol=1e-14)
    np.testing.assert_array_equal(problem.to_z(problem.lower), [0.0, 0.0])
    np.testing.assert_array_equal(problem.to_z(problem.upper), [1.0, 1.0])


@pytest.mark.parametrize(
    ("lower", "upper", "words"),
    [(2.0, 1.0, "exchange them"), (1.0, 1.0, "below"), (float("nan"), 1.0, "finite")],
)
def test_wrong_bounds_are_named(lower: float, upper: float, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        Variable("length", lower, upper, "mm")


def test_start_outside_its_bounds_is_named_with_value_and_limit() -> None:
    with pytest.raises(ConfigError, match=r"baseline l = 5 mm .* 0 to 1"):
        Problem((Variable("l", 0.0, 1.0, "mm"),), np.array([5.0]))
