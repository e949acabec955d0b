"""A physical effect that a simulation can switch on, and where its influence is nothing."""

import difflib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from mfopt.errors import ConfigError
from mfopt.names import with_unit

# A value further from 0 than so many times the plausible range is a slip, such as of the unit. It
# may need more steps or memory than there are.
BEYOND = 10.0

Tag = Literal["material", "apparatus", "measurement", "numerics"]


@dataclass(frozen=True, slots=True)
class EffectParameter:
    """One number that an effect takes."""

    null: float  # the value at which the effect is absent; of a `shapes` parameter the usual value
    low: float  # plausible range
    high: float
    unit: str  # SI; "-" for a pure number
    meaning: str
    shapes: bool = False  # True: says how the effect acts, not whether it is there

    def __post_init__(self) -> None:
        if not -math.inf < self.low <= self.null <= self.high < math.inf:
            raise ConfigError(
                f"null = {self.null:g} of an effect's parameter must lie in its plausible range "
                f"{self.low:g} to {self.high:g}, and both ends must be finite; widen the range"
            )

    @property
    def most(self) -> float:
        """The largest magnitude that is accepted."""
        return BEYOND * max(-self.low, self.high)


@dataclass(frozen=True, slots=True)
class Effect:
    """What an effect is called, what it takes, and where it comes from.

    The effect is absent as soon as one parameter that is no `shapes` parameter is at its null.
    """

    name: str
    parameters: Mapping[str, EffectParameter]
    tag: Tag  # what is to blame if the effect is there
    equation: str
    source: str

    def __post_init__(self) -> None:
        if all(parameter.shapes for parameter in self.parameters.values()):
            raise ConfigError(
                f"effect {self.name!r}: none of its {len(self.parameters)} parameters has a null "
                "that switches it off; give at least 1"
            )


def complete(effect: Effect, values: Mapping[str, float]) -> dict[str, float]:
    """All parameters of the effect: `values`, and the null where they name none.

    Raises:
        ConfigError: if a name is unknown, or a value is not a finite number, below 0 where only
            positive ones are plausible, or far beyond the plausible range.
    """
    for name, value in values.items():
        if name not in effect.parameters:
            near = difflib.get_close_matches(name, effect.parameters, n=1, cutoff=0.0)
            raise ConfigError(
                f"effect {effect.name!r} has no parameter {name!r}; the nearest is {near[0]!r}"
            )
        if not math.isfinite(value):
            raise ConfigError(f"effect {effect.name!r}: {name} = {value} must be a finite number")
        its = effect.parameters[name]
        _refuse_far(its, f"effect {effect.name!r}: {name}", value)
    nulls = {name: parameter.null for name, parameter in effect.parameters.items()}
    return {**nulls, **values}


def _refuse_far(its: EffectParameter, name: str, value: float) -> None:
    said = f"{name} = {with_unit(value, its.unit)}"
    plausible = f"plausible is {its.low:g} to {with_unit(its.high, its.unit)}"
    if its.low >= 0.0 > value:
        raise ConfigError(f"{said} must be at least 0; {plausible}")
    if abs(value) > its.most:
        raise ConfigError(f"{said} must be at most {its.most:g} in magnitude; {plausible}")


def is_absent(effect: Effect, values: Mapping[str, float]) -> bool:
    """Whether the effect does nothing at these values; a missing one is at its null."""
    given = complete(effect, values)
    return any(
        given[name] == parameter.null
        for name, parameter in effect.parameters.items()
        if not parameter.shapes
    )
