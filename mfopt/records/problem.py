"""The design problem: variables with units and bounds, and what makes a design impossible."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from itertools import islice

import numpy as np

from mfopt.arrays import Array, frozen
from mfopt.checks import name_of, number, shown
from mfopt.errors import ConfigError, SimulationError
from mfopt.names import with_unit

REDRAWS = 1000  # draws for one possible design before giving up
LARGEST_BOUND = 1e100  # beyond it squares overflow

Constraint = Callable[[Array], str | None]  # (d,) -> why the design is impossible, or None


@dataclass(frozen=True, slots=True)
class Variable:
    """One design variable with its bounds in physical units."""

    name: str
    lower: float
    upper: float
    unit: str = "-"

    def __post_init__(self) -> None:
        name_of("a variable", self.name)
        for which in ("lower", "upper"):
            where = f"variable {self.name!r}: {which} bound"
            bound = number(where, getattr(self, which), -LARGEST_BOUND, LARGEST_BOUND)
            object.__setattr__(self, which, bound)
        if self.lower == self.upper:
            raise ConfigError(
                f"variable {self.name!r}: both bounds are {self.lower:g}; raise the upper bound, "
                "or do not make it a variable"
            )
        if self.lower > self.upper:
            raise ConfigError(
                f"variable {self.name!r}: lower bound {self.lower:g} must be below "
                f"upper bound {self.upper:g}; exchange them"
            )

    @property
    def middle(self) -> float:
        """The middle of the bounds."""
        return (self.lower + self.upper) / 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """Variables to be chosen so that the objective becomes smallest.

    `baseline` is the design to compare with and to start from; `constraint` names why a
    design is impossible (a hard constraint: such a design is never simulated).

    Raises:
        ConfigError: if names repeat, or the baseline is out of bounds or impossible.
    """

    variables: tuple[Variable, ...]
    baseline: Array  # (d,) physical units
    constraint: Constraint | None = None
    objective_unit: str = "-"

    def __post_init__(self) -> None:
        names = [v.name for v in self.variables]
        if not names:
            raise ConfigError("the problem has no variables: free at least one")
        if len(set(names)) < len(names):
            raise ConfigError(f"variable names must differ: {', '.join(names)}")
        object.__setattr__(self, "baseline", frozen(self.baseline))
        self.start(self.baseline)

    @property
    def dimension(self) -> int:
        """Number of variables."""
        return len(self.variables)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the variables, in the order of x."""
        return tuple(v.name for v in self.variables)

    @property
    def lower(self) -> Array:
        """Lower bounds (d,), physical units."""
        return frozen([v.lower for v in self.variables])

    @property
    def upper(self) -> Array:
        """Upper bounds (d,), physical units."""
        return frozen([v.upper for v in self.variables])

    def to_x(self, z: Array) -> Array:
        """Map the unit cube to physical units, (..., d); rounding leads out of no bound."""
        x = self.lower + z * (self.upper - self.lower)
        return np.asarray(np.clip(x, self.lower, self.upper))

    def to_z(self, x: Array) -> Array:
        """Map physical units to the unit cube, (..., d)."""
        return np.asarray((x - self.lower) / (self.upper - self.lower))

    def start(self, x: Array) -> Array:
        """The design `x` (d,) in the unit cube, for a search to begin with.

        Raises:
            ConfigError: if it is out of bounds or impossible.
        """
        if x.shape != (self.dimension,):
            raise ConfigError(
                f"baseline has {x.size} values, the problem {self.dimension} variables"
            )
        for value, v in zip(x, self.variables, strict=True):
            if not v.lower <= value <= v.upper:
                raise ConfigError(
                    f"baseline {v.name} = {with_unit(value, v.unit)} is outside its bounds "
                    f"{v.lower:g} to {v.upper:g}; move the start or widen the bounds"
                )
        z = self.to_z(x)
        if (why := self.impossible(x) or self.impossible(self.to_x(z))) is not None:
            raise ConfigError(
                f"the design {self.shown(x)} is impossible: {why}; change this design or the "
                "other settings"
            )
        return z

    def impossible(self, x: Array) -> str | None:
        """Why the design `x` (d,) can never be built, or None.

        Raises:
            ConfigError: if the constraint returns anything else.
        """
        why = None if self.constraint is None else self.constraint(x)
        if why is not None and not isinstance(why, str):
            raise ConfigError(
                f"the constraint returned {shown(why)}; it must return None for a possible "
                "design, and else in words why it is impossible"
            )
        return why

    def possible(self, draws: Iterable[Array]) -> Array:
        """The first of the designs (d,) drawn in the unit cube that can be built.

        Raises:
            SimulationError: if a thousand in a row cannot.
        """
        reason: str | None = None
        for z in islice(draws, REDRAWS):
            reason = self.impossible(self.to_x(z))
            if reason is None:
                return z
        raise SimulationError(
            f"{REDRAWS} designs drawn in a row are impossible, the last because {reason}; "
            "widen the bounds or start from another design"
        )

    def shown(self, x: Array) -> str:
        """The design `x` (d,) in words."""
        pairs = zip(self.variables, x, strict=True)
        return ", ".join(f"{v.name} = {with_unit(value, v.unit)}" for v, value in pairs)

    def named(self, x: Array) -> Mapping[str, float]:
        """The design `x` (d,) by variable name."""
        return {name: float(value) for name, value in zip(self.names, x, strict=True)}
