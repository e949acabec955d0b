"""Objectives, computed from stored raw outcomes so that they can be changed afterwards.

An objective maps the raw results of a finished run to named terms; its value is their sum,
always minimised.

Source: paper on the optimisation of a vertical tubular bag machine, eqs. 2-5.
"""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from mfopt.arrays import AnyArray, Array
from mfopt.errors import ConfigError
from mfopt.outcome import Outcome

Raw = Mapping[str, AnyArray]
Objective = Callable[[Raw], dict[str, float]]

LAST_GRAINS_IGNORED = 20  # eq. 4: stragglers must not decide
WEIGHT_LEFT_IN_CUP = 0.05  # eq. 2
WEIGHT_LEFT_IN_HOPPER = 0.5  # eq. 3


COUNTS = ("left in cup", "left in hopper")  # terms that count what a design must not leave


def _penalties(raw: Raw) -> dict[str, float]:
    return {
        "left in cup": WEIGHT_LEFT_IN_CUP * float(raw["left_in_cup"]),
        "left in hopper": WEIGHT_LEFT_IN_HOPPER * float(raw["left_in_hopper"]),
    }


def dispersion(raw: Raw) -> dict[str, float]:
    """f = g + lc + lh with g the standard deviation of the passage times, last 20 left out.

    With two or fewer times to take it from, g is the `duration` of the run [s], longer than
    any standard deviation within it.
    """
    times = np.sort(raw["passage_times"])[:-LAST_GRAINS_IGNORED]
    g = float(np.std(times)) if times.size > 2 else float(raw["duration"])
    return {"dispersion": g, **_penalties(raw)}


def filling_time(raw: Raw) -> dict[str, float]:
    """Time between the first and the last grain at the tube's end [s], and the penalties."""
    times = raw["passage_times"]
    span = float(times.max() - times.min()) if times.size > 2 else float(raw["duration"])
    return {"filling time": span, **_penalties(raw)}


def returned(raw: Raw) -> dict[str, float]:
    """The number `f` that the simulation itself returned."""
    return {"f": float(raw["f"])}


OBJECTIVES: Mapping[str, Objective] = {
    "dispersion": dispersion,
    "filling_time": filling_time,
    "returned": returned,
}


def objective_named(name: str) -> Objective:
    """Look an objective up by its name in study files.

    Raises:
        ConfigError: if there is none of that name.
    """
    if name not in OBJECTIVES:
        raise ConfigError(f"unknown objective {name!r}; choose from {', '.join(OBJECTIVES)}")
    return OBJECTIVES[name]


def value(objective: Objective, outcome: Outcome) -> float:
    """Objective value of a run; infinite if the run failed or gave no number."""
    if not outcome.finished:
        return math.inf
    f = sum(objective(outcome.raw).values())
    return f if math.isfinite(f) else math.inf


def counts(objective: Objective, outcomes: Sequence[Outcome]) -> Array:
    """Soft-constraint terms (n, c) of runs, weighted as in their value; 0 for a failed run."""
    rows = [objective(outcome.raw) if outcome.finished else {} for outcome in outcomes]
    return np.array([[row.get(name, 0.0) for name in COUNTS] for row in rows])
