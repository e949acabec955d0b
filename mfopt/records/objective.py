"""How the runs of a problem are judged: objectives and quantities, computed from raw outcomes.

An objective maps the raw results of a finished run to named terms. Its value is their sum, always
minimised. Outcomes are stored raw, so objectives can be changed afterwards.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from mfopt.arrays import AnyArray, Array
from mfopt.errors import ConfigError
from mfopt.records.outcome import Outcome

Raw = Mapping[str, AnyArray]


@dataclass(frozen=True, slots=True, eq=False)
class Objective:
    """What a search makes as small as possible."""

    name: str
    terms: Callable[[Raw], dict[str, float]]  # the value is their sum
    # Names of the terms that say by how much a design misses a requirement; 0 where it does not.
    constraints: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Quantity:
    """A number of a finished run that an engineer asks for."""

    name: str
    unit: str  # SI; "-" for a share
    read: Callable[[Raw], float]  # nan where the run gives no value
    shown: tuple[float, str]  # factor and unit in tables, such as (1e3, "ms")
    limit: float | None = None  # that the study sets: at most this
    lower_is_better: bool = True  # False: neither way is worse in itself
    wanted: float | None = None  # value that the study asks for
    can_vanish: bool = False  # True: good runs have values near 0


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """A quantity over time of a finished run."""

    name: str
    unit: str  # SI; "-" for a share
    read: Callable[[Raw], tuple[Array, Array]]  # times (s,) [s] and values (s,)
    shown: tuple[float, str]  # factor and unit in figures


@dataclass(frozen=True, slots=True, eq=False)
class Criteria:
    """How the runs of a problem are judged, and what is read off them."""

    objectives: Mapping[str, Objective]
    quantities: tuple[Quantity, ...] = ()  # each stands for itself in tables
    beside: str | None = None  # name of the quantity that pages show beside the objective
    series: tuple[Series, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)  # what the study chose, for JSON
    needs: Mapping[str, str] = field(default_factory=dict)  # missing key, of absent objectives

    def objective(self, name: str) -> Objective:
        """The objective of that name.

        Raises:
            ConfigError: if there is none.
        """
        if name in self.needs:
            raise ConfigError(f"objective {name!r} needs {self.needs[name]}; give it in [problem]")
        if name not in self.objectives:
            raise ConfigError(
                f"unknown objective {name!r}; choose from {', '.join(self.objectives)}"
            )
        return self.objectives[name]

    def quantities_of(self, outcome: Outcome) -> dict[str, float]:
        """The quantities of a run; none of a run that failed, or does not give them.

        A quantity without a value (nan) is left out.
        """
        if not outcome.finished:
            return {}
        try:
            read = {its.name: float(its.read(outcome.raw)) for its in self.quantities}
        except (KeyError, TypeError, ValueError, ArithmeticError):
            return {}
        return {name: value for name, value in read.items() if not math.isnan(value)}


def returned(raw: Raw) -> dict[str, float]:
    """The number `f` that the simulation itself returned."""
    return {"f": float(raw["f"])}


RETURNED = Objective("returned", returned)
OWN = Criteria({"returned": RETURNED})  # of a problem of the user's own


def judged(objective: Objective, outcome: Outcome) -> tuple[Outcome, float]:
    """A run with its objective value, which is infinite if the run failed.

    A run from which the objective cannot be computed, or is no finite number, has crashed.
    """
    if not outcome.finished:
        return outcome, math.inf
    try:
        f = float(sum(objective.terms(outcome.raw).values()))
    except (KeyError, TypeError, ValueError, ZeroDivisionError, OverflowError) as error:
        lacks = f"the run lacks {error}" if isinstance(error, KeyError) else str(error)
        why = f"the objective cannot be computed from what the run gave: {lacks}"
    else:
        if math.isfinite(f):
            return outcome, f
        why = f"the objective of the run is {f}, no finite number"
    return replace(outcome, status="crashed", why=why), math.inf


def value(objective: Objective, outcome: Outcome) -> float:
    """Objective value of a run; infinite if the run failed or gave no number."""
    return judged(objective, outcome)[1]


def missed(objective: Objective, outcomes: Sequence[Outcome]) -> Array:
    """Soft-constraint terms (n, c) of runs, weighted as in their value; 0 for a failed run."""
    rows = [objective.terms(o.raw) if o.finished else {} for o in outcomes]
    terms = [[row.get(name, 0.0) for name in objective.constraints] for row in rows]
    return np.reshape(np.array(terms, dtype=float), (len(outcomes), len(objective.constraints)))
