"""Runs of the assisted search beside those of its generations: repeats, validations, the last ones.

Each function tells from the archive and the plan what is to be run, or was; `Plan` holds the runs.
"""

import numpy as np

from mfopt.arrays import Array
from mfopt.search.archive import Archive
from mfopt.search.plan import Plan
from mfopt.search.recommendation import scatters

WITH_START = 3.0  # least budget [target runs] of which one is kept to run the start at the target
REPEAT_LEFT = 5.0  # budget left [target runs] of which one tells whether runs there scatter
MOST_OWED = 2  # runs that the end needs at the target


def asked(archive: Archive, plan: Plan, z: Array, level: int) -> bool:
    """Whether the design `z` (d,) was asked for at a level."""
    run = bool((archive.designs_at(level) == z).all(axis=1).any())
    return run or any(np.array_equal(z, other) for other in plan.out_at(level))


def owed(archive: Archive, plan: Plan, start: Array, best: Array | None, level: int) -> int:
    """Runs that the end needs at the target: of the recommended design, and of the start.

    That of the start is left out of a budget of fewer than `WITH_START` runs.

    Args:
        archive: all runs.
        plan: what is planned and out.
        start: (d,) first design.
        best: (d,) the recommended design; None before a run has finished.
        level: that the search works at.
    """
    ladder = plan.target > 0 and plan.budget >= WITH_START * plan.costs[-1]
    first = ladder and not asked(archive, plan, start, plan.target)
    if best is None:
        return first + (level < plan.target)
    return first + (not asked(archive, plan, best, plan.target))


def to_repeat(archive: Archive, plan: Plan, level: int, lowest: int) -> Array | None:
    """The design (d,) to run again at a level, on another seed: then we know whether runs scatter.

    At the target of a ladder, where runs are dear, only if nothing is known from the level below,
    and only if so many runs are left that one is little. `lowest` is the first level that counts.
    """
    finished = archive.finished_at(level)
    if not len(finished):
        return None
    if lowest < level == plan.target:
        left = plan.left_after(level) / plan.costs[-1]
        if left < REPEAT_LEFT or scatters(archive, level, plan.target) is not None:
            return None
    return np.asarray(archive.z[finished[-1]])


def to_validate(archive: Archive, plan: Plan, start: Array, best: Array, above: int) -> list[Array]:
    """Designs (d,) to run one level up, at first with the start; none beyond the budget."""
    designs = [best] if len(archive.values_at(above)) else [start, best]
    return designs if plan.left_after(above, len(designs)) >= 0.0 else []
