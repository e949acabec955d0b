"""Designs of scenes whose variables are plain lengths and angles."""

from collections.abc import Mapping

from mfopt.arrays import Array, frozen
from mfopt.records.problem import Constraint, Problem, Variable

Bounds = tuple[float, float]


def problem_of(
    values: Mapping[str, float],
    free: Mapping[str, Bounds],
    units: Mapping[str, str],
    *,
    constraint: Constraint | None = None,
    objective_unit: str = "-",
) -> Problem:
    """The free parameters as variables; their values in the settings are the baseline.

    Raises:
        ConfigError: if the baseline is out of bounds or impossible.
    """
    variables = tuple(Variable(name, low, high, units[name]) for name, (low, high) in free.items())
    baseline = frozen([values[name] for name in free])
    return Problem(variables, baseline, constraint, objective_unit=objective_unit)


def values_at(
    values: Mapping[str, float], free: Mapping[str, Bounds], x: Array
) -> dict[str, float]:
    """Value of every parameter at the design `x` (d,)."""
    return {**values, **dict(zip(free, map(float, x), strict=True))}
