import numpy as np
import pytest

from mfopt.errors import ConfigError
from mfopt.records.problem import Problem, Variable


def test_unit_cube_and_back_is_the_identity() -> None:
    problem = Problem((Variable("a", -2.0, 3.0), Variable("b", 10.0, 11.0)), np.array([0.0, 10.5]))
    x = np.random.default_rng(0).uniform(problem.lower, problem.upper, (50, 2))
    np.testing.assert_allclose(problem.to_x(problem.to_z(x)), x, rtol=1e-14)
    np.testing.assert_array_equal(problem.to_z(problem.lower), [0.0, 0.0])
    np.testing.assert_array_equal(problem.to_z(problem.upper), [1.0, 1.0])


@pytest.mark.parametrize(
    ("lower", "upper", "words"),
    [
        (2.0, 1.0, "exchange them"),
        (1.0, 1.0, "bounds are 1; raise the upper"),
        (float("nan"), 1.0, "finite"),
    ],
)
def test_wrong_bounds_are_named(lower: float, upper: float, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        Variable("length", lower, upper, "mm")


def test_start_outside_its_bounds_is_named_with_value_and_limit() -> None:
    with pytest.raises(ConfigError, match=r"baseline l = 5 mm .* 0 to 1"):
        Problem((Variable("l", 0.0, 1.0, "mm"),), np.array([5.0]))


def test_x_never_leaves_its_bounds() -> None:
    rng = np.random.default_rng(1)
    for _ in range(2000):
        ends = np.sort(rng.normal(size=2) * 10.0 ** rng.integers(-12, 12, 2))
        problem = Problem((Variable("a", *ends),), ends[:1])
        for z in (0.0, 1.0, np.nextafter(1.0, 0.0), np.nextafter(0.0, 1.0), rng.uniform()):
            (x,) = problem.to_x(np.array([z]))
            assert ends[0] <= x <= ends[1]
    assert Problem((Variable("a", -3.0, -0.9),), np.array([-1.0])).to_x(np.ones(1)) == -0.9


@pytest.mark.parametrize("lower", [-2e100, "0", True, None, -np.inf])
def test_bounds_that_are_no_usable_numbers_are_named(lower: object) -> None:
    with pytest.raises(ConfigError, match="variable 'a': lower bound = "):
        Variable("a", lower, 1.0)  # type: ignore[arg-type]


def test_an_impossible_start_is_refused_with_its_reason() -> None:
    with pytest.raises(ConfigError, match=r"the design l = 0\.5 is impossible: too wide; change"):
        Problem((Variable("l", 0.0, 1.0),), np.array([0.5]), lambda x: "too wide")


def test_a_constraint_that_answers_with_a_truth_value_is_named() -> None:
    with pytest.raises(ConfigError, match="the constraint returned False; it must return None"):
        Problem((Variable("l", 0.0, 1.0),), np.array([0.5]), lambda x: bool(x[0] > 0.9))  # type: ignore[arg-type, return-value]
