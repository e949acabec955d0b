"""When the assisted search looks one level up, and when it moves there.

Every so often the design recommended so far is run once at the next level: a validation. The
search moves up when validations stop improving, when the ranking that CMA-ES uses is decided at
its level but in doubt at the next one, when it has converged, when its share is spent, or when
most runs fail.
"""

from dataclasses import dataclass

import numpy as np

from mfopt.arrays import Array
from mfopt.search.archive import Archive

VALIDATE_COST = 2.0  # spent at a level before a validation, in runs of the next level, or
VALIDATE_RUNS = 40  # runs at a level before a validation, if that is less
PATIENCE = 2  # validations without an improvement
FEWEST_VALIDATIONS = 6  # before rankings at two levels are compared
DOUBT = 0.5  # certainty at the next level over that at this one, below which it moves up
CONVERGED = 2e-3  # widest standard deviation, unit cube: finer at a coarse level is vain
ALL_OF = 12  # first runs at a level: where they all fail, it is of no use,
MOST_OF = 40  # nor where of so many runs or more
MOST = 0.8  # more than this share failed
BELOW_SHARE = 0.6  # of the budget, for all levels below the target together


@dataclass(frozen=True, slots=True)
class Standing:
    """Where the search stands at its level."""

    level: int
    archive: Archive
    below_share: float  # of the budget, spent below the target
    widest: float  # standard deviation of the distribution, unit cube
    certainty: float  # of the ranking at this level
    certainty_above: float  # of the ranking at the next level


def validation_due(spent: float, runs: int, cost_above: float) -> bool:
    """Whether enough was spent at a level since the last look at the next one."""
    return runs >= VALIDATE_RUNS or spent >= VALIDATE_COST * cost_above


def why_climb(standing: Standing) -> str | None:
    """Why the search should move up one level, in words; None if it should not."""
    if (failing := why_leave(standing.archive, standing.level)) is not None:
        return failing
    above = standing.archive.values_at(standing.level + 1)
    if standing.widest < CONVERGED:
        return "converged"
    if standing.below_share > BELOW_SHARE:
        return f"{BELOW_SHARE:.0%} of the budget is spent below the target"
    if len(above) >= FEWEST_VALIDATIONS and (standing.certainty_above < DOUBT * standing.certainty):
        return "the ranking at the next level is in doubt"
    if len(above) and len(above) - 1 - int(np.argmin(above)) >= PATIENCE:
        return "validations at the next level no longer improve"
    return None


def why_leave(archive: Archive, level: int) -> str | None:
    """Why a level is of no use because its runs fail, in words; None if it is of use."""
    failed = ~np.isfinite(archive.values_at(level))
    if len(failed) >= ALL_OF and failed.all():
        return f"all of its first {len(failed)} runs failed"
    if len(failed) >= MOST_OF and failed.mean() > MOST:
        return f"{failed.sum()} of its {len(failed)} runs failed"
    return None


def misled(archive: Archive, start: Array, above: int) -> bool:
    """Whether no validation at the level `above` beat the first design `start` (d,).

    That is run there beside the first validation.
    """
    return archive.beats_others(start, above)
