"""Objectives of a dosing run, and what an engineer asks of one.

Levels differ in their number of grains, so what is left out and what stays behind count as shares
of the portion; at `reference_grains` the shares are the paper's counts.

Source: paper on the optimisation of a vertical tubular bag machine, eqs. 2-5.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial

import numpy as np
from pydantic import Field

from mfopt.arrays import Array
from mfopt.limits import Milliseconds
from mfopt.records.objective import Criteria, Objective, Quantity, Raw, Series
from mfopt.settings import Settings

LAST_GRAINS_IGNORED = 20.0  # eq. 4: stragglers must not decide
WEIGHT_LEFT_IN_CUP = 0.05  # a grain, eq. 2
WEIGHT_LEFT_IN_HOPPER = 0.5  # a grain, eq. 3
FEWEST_TIMES = 3  # of which a spread or a span is taken

Terms = Callable[[Raw, "Weights"], dict[str, float]]

# Terms that say by how much a design misses what the machine needs; 0 where it does not.
CONSTRAINTS = ("left in cup", "left in hopper", "over time limit")


class Wanted(Settings):
    """What a study can say of the objectives, beside the name of one."""

    # Of which the paper counts; the spread leaves out the last 20, and needs some to be left.
    reference_grains: int = Field(default=4600, gt=LAST_GRAINS_IGNORED, le=10**9)
    filling_time_limit_ms: Milliseconds | None = None
    filling_time_weight: float = Field(default=0.5, ge=0.0, le=1e9)  # of a second above the limit


@dataclass(frozen=True, slots=True)
class Weights:
    """`Wanted` in SI units."""

    reference_grains: int = 4600  # the portion of which the paper counts the grains
    filling_time_limit_s: float | None = None  # a filling time below it costs nothing
    filling_time_weight: float = 0.5  # of each second above the limit [1/s]


DEFAULTS = Weights()


def weights_of(wanted: Wanted) -> Weights:
    """The study's choice in SI units."""
    limit = wanted.filling_time_limit_ms
    limit_s = None if limit is None else 1e-3 * limit
    return Weights(wanted.reference_grains, limit_s, wanted.filling_time_weight)


def criteria(weights: Weights = DEFAULTS) -> Criteria:
    """How dosing runs are judged."""
    return Criteria(
        {
            name: Objective(name, partial(_weighed, terms, weights), CONSTRAINTS)
            for name, terms in OBJECTIVES.items()
        },
        (
            Quantity("dispersion", "s", partial(_dispersion, weights), (1e3, "ms")),
            Quantity("filling time", "s", span, (1e3, "ms"), weights.filling_time_limit_s),
            Quantity("mass left", "-", mass_left, (1e2, "%"), can_vanish=True),
        ),
        "filling time",
        (Series("share passed", "-", passed_share, (1e2, "%")),),
        asdict(weights),
    )


def _weighed(terms: Terms, weights: Weights, raw: Raw) -> dict[str, float]:
    return terms(raw, weights)


def dispersion(raw: Raw, weights: Weights = DEFAULTS) -> dict[str, float]:
    """f = g + lc + lh + t: spread of the passage times, mass left, and time above the limit.

    g is the standard deviation of the passage times without the last 20 / `reference_grains` of
    the portion [s]; where only a part of a grain is left out, that grain weighs the rest.
    """
    return {"dispersion": _dispersion(weights, raw), **_missed(raw, weights)}


def filling_time(raw: Raw, weights: Weights = DEFAULTS) -> dict[str, float]:
    """Time between the first and the last grain at the tube's end [s], and what is missed."""
    return {"filling time": span(raw), **_missed(raw, weights)}


def paper_dispersion(raw: Raw, weights: Weights = DEFAULTS) -> dict[str, float]:
    """`dispersion` as the paper counts: the last 20 grains left out, a price for each grain left.

    At another number of grains `paper_dispersion` means another thing.
    """
    return dispersion(raw, replace(weights, reference_grains=int(raw["grains"])))


OBJECTIVES: dict[str, Terms] = {
    "dispersion": dispersion,
    "filling_time": filling_time,
    "paper_dispersion": paper_dispersion,
}


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


def passed_share(raw: Raw) -> tuple[Array, Array]:
    """Share of the grains that have passed the tube's end, at every passage."""
    times = np.concatenate([[0.0], raw["passage_times"], [float(raw["duration"])]])
    passed = len(raw["passage_times"])
    count = np.concatenate([np.arange(passed + 1.0), [passed]])
    return times, count / float(raw["grains"])


def mass_left(raw: Raw) -> float:
    """Share of the portion that stays behind, in the cup or in the hopper."""
    left = float(raw["left_in_cup"]) + float(raw["left_in_hopper"])
    return left / float(raw["grains"])


def _dispersion(weights: Weights, raw: Raw) -> float:
    """Spread of the passage times [s] without the last of the portion."""
    return spread(raw, LAST_GRAINS_IGNORED * float(raw["grains"]) / weights.reference_grains)


def _missed(raw: Raw, weights: Weights) -> dict[str, float]:
    """The soft constraints, weighted."""
    scale = weights.reference_grains / float(raw["grains"])
    limit = weights.filling_time_limit_s
    over = 0.0 if limit is None else max(0.0, span(raw) - limit)
    return {
        "left in cup": WEIGHT_LEFT_IN_CUP * scale * float(raw["left_in_cup"]),
        "left in hopper": WEIGHT_LEFT_IN_HOPPER * scale * float(raw["left_in_hopper"]),
        "over time limit": weights.filling_time_weight * over,
    }
