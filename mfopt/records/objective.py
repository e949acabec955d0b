"""Objectives, computed from stored raw outcomes so that they can be changed afterwards.

An objective maps the raw results of a finished run to named terms; its value is their sum,
always minimised. Levels differ in their number of grains, so what is left out and what stays
behind count as shares of the portion; at `reference_grains` the shares are the paper's counts.

Source: paper on the optimisation of a vertical tubular bag machine, eqs. 2-5.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from mfopt.arrays import AnyArray, Array
from mfopt.errors import ConfigError
from mfopt.records.outcome import Outcome

Raw = Mapping[str, AnyArray]
Objective = Callable[[Raw], dict[str, float]]

LAST_GRAINS_IGNORED = 20.0  # eq. 4: stragglers must not decide
WEIGHT_LEFT_IN_CUP = 0.05  # a grain, eq. 2
WEIGHT_LEFT_IN_HOPPER = 0.5  # a grain, eq. 3
FEWEST_TIMES = 3  # of which a spread or a span is taken

# Terms that say by how much a design misses what the machine needs; 0 where it does not.
CONSTRAINTS = ("left in cup", "left in hopper", "over time limit")


@dataclass(frozen=True, slots=True)
class ObjectiveSettings:
    """What a study can change about the objectives of a dosing run."""

    reference_grains: int = 4600  # the portion of which the paper counts the grains
    filling_time_limit_s: float | None = None  # a filling time below it costs nothing
    filling_time_weight: float = 0.5  # of each second above the limit [1/s]

    def __post_init__(self) -> None:
        if self.reference_grains < 1:
            raise ConfigError(
                f"reference_grains = {self.reference_grains} must be at least 1; the paper has 4600"
            )
        limit, weight = self.filling_time_limit_s, self.filling_time_weight
        if limit is not None and not 0.0 < limit < math.inf:
            raise ConfigError(f"filling_time_limit_s = {limit} must be above 0; leave it out")
        if not 0.0 <= weight < math.inf:
            raise ConfigError(f"filling_time_weight = {weight} must be at least 0")

    def described(self) -> dict[str, Any]:
        """The settings in what JSON can hold; `ObjectiveSettings(**described)` reads them back."""
        return asdict(self)


DEFAULTS = ObjectiveSettings()


def dispersion(raw: Raw, settings: ObjectiveSettings = DEFAULTS) -> dict[str, float]:
    """f = g + lc + lh + t: spread of the passage times, mass left, and time above the limit.

    g is the standard deviation of the passage times without the last 20 / `reference_grains` of
    the portion [s]; where only a part of a grain is left out, that grain weighs the rest.
    """
    return {"dispersion": spread(raw, _last(raw, settings)), **_missed(raw, settings)}


def filling_time(raw: Raw, settings: ObjectiveSettings = DEFAULTS) -> dict[str, float]:
    """Time between the first and the last grain at the tube's end [s], and what is missed."""
    return {"filling time": span(raw), **_missed(raw, settings)}


def paper_dispersion(raw: Raw, settings: ObjectiveSettings = DEFAULTS) -> dict[str, float]:
    """`dispersion` as the paper counts: the last 20 grains left out, a price for each grain left.

    It means another thing at another number of grains.
    """
    as_counted = replace(settings, reference_grains=int(raw["grains"]))
    return dispersion(raw, as_counted)


def returned(raw: Raw, settings: ObjectiveSettings = DEFAULTS) -> dict[str, float]:
    """The number `f` that the simulation itself returned."""
    return {"f": float(raw["f"])}


def spread(raw: Raw, ignored: float) -> float:
    """Standard deviation of the passage times [s] without the last `ignored` grains.

    With fewer than three times to take it from, it is the `duration` of the run, longer than any
    standard deviation within it.
    """
    times = np.sort(raw["passage_times"])
    weights = np.clip(np.arange(times.size, 0, -1) - ignored, 0.0, 1.0)
    if np.count_nonzero(weights) < FEWEST_TIMES:
        return float(raw["duration"])
    mean = np.average(times, weights=weights)
    return float(np.sqrt(np.average((times - mean) ** 2, weights=weights)))


def span(raw: Raw) -> float:
    """Time between the first and the last grain [s]; the duration if fewer than three passed."""
    times = raw["passage_times"]
    return float(np.ptp(times)) if times.size >= FEWEST_TIMES else float(raw["duration"])


def quantities(raw: Raw, settings: ObjectiveSettings = DEFAULTS) -> dict[str, float] | None:
    """What an engineer asks of a dosing run; None where the run is of another kind.

    Returns:
        `dispersion` [s], `filling time` [s] and `mass left`, a share of the portion.
    """
    if not {"passage_times", "left_in_cup", "left_in_hopper", "grains"} <= raw.keys():
        return None
    left = float(raw["left_in_cup"]) + float(raw["left_in_hopper"])
    return {
        "dispersion": spread(raw, _last(raw, settings)),
        "filling time": span(raw),
        "mass left": left / float(raw["grains"]),
    }


def _last(raw: Raw, settings: ObjectiveSettings) -> float:
    """Grains that are left out of the spread."""
    return LAST_GRAINS_IGNORED * float(raw["grains"]) / settings.reference_grains


def _missed(raw: Raw, settings: ObjectiveSettings) -> dict[str, float]:
    """The soft constraints, weighted."""
    scale = settings.reference_grains / float(raw["grains"])
    limit = settings.filling_time_limit_s
    over = 0.0 if limit is None else max(0.0, span(raw) - limit)
    return {
        "left in cup": WEIGHT_LEFT_IN_CUP * scale * float(raw["left_in_cup"]),
        "left in hopper": WEIGHT_LEFT_IN_HOPPER * scale * float(raw["left_in_hopper"]),
        "over time limit": settings.filling_time_weight * over,
    }


OBJECTIVES: Mapping[str, Callable[[Raw, ObjectiveSettings], dict[str, float]]] = {
    "dispersion": dispersion,
    "filling_time": filling_time,
    "paper_dispersion": paper_dispersion,
    "returned": returned,
}


def objective_named(name: str, settings: ObjectiveSettings = DEFAULTS) -> Objective:
    """Look an objective up by its name in study files.

    Raises:
        ConfigError: if there is none of that name.
    """
    if name not in OBJECTIVES:
        raise ConfigError(f"unknown objective {name!r}; choose from {', '.join(OBJECTIVES)}")
    return lambda raw: OBJECTIVES[name](raw, settings)


def judged(objective: Objective, outcome: Outcome) -> tuple[Outcome, float]:
    """A run with its objective value, which is infinite if the run failed.

    A run from which the objective cannot be computed, or is no finite number, has crashed.
    """
    if not outcome.finished:
        return outcome, math.inf
    try:
        f = float(sum(objective(outcome.raw).values()))
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
    rows = [objective(outcome.raw) if outcome.finished else {} for outcome in outcomes]
    return np.array([[row.get(name, 0.0) for name in CONSTRAINTS] for row in rows])
