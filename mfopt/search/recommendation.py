"""The design that the assisted search would hand over, and what it believes of it."""

import numpy as np

from mfopt.arrays import Array
from mfopt.records.problem import Problem
from mfopt.search.archive import Archive
from mfopt.search.belief import Belief
from mfopt.search.distribution import Distribution

OVERCONFIDENCE = 2.0  # error over posterior deviation in the design that the posterior itself
# chose, so that 95 % intervals hold; measured by `benchmarks.search.coverage`, instances 6-8


def recommended(
    archive: Archive,
    belief: Belief | None,
    distribution: Distribution,
    problem: Problem,
    *,
    level: int,
    target: int,
    fewest: int,
    among_runs: bool,
) -> Array | None:
    """The best design (d,) in the posterior, doubt counted against it (`Belief.best`).

    Where runs do not scatter it is simply the best run, and in the end also where none was run
    again, so that nothing is known of scatter.

    Args:
        level: that it is to be best at.
        target: the last level.
        fewest: so many of the nearest count as nearby, however far they are.
        among_runs: choose among the designs that were run at the level, if there are any.

    Returns:
        None before a run has finished.
    """
    scatter = scatters(archive, level, target)
    if len(archive.finished_at(level)) and (scatter is False or (scatter is None and among_runs)):
        return archive.best_at(level)[0]
    if belief is not None:
        centre = _centre(archive, distribution, problem)
        its = (centre, distribution.to_u(centre)[0])
        return belief.best(level, fewest, its, archive.designs_at(level) if among_runs else None)
    if archive.finished == 0:
        return None
    return np.asarray(archive.z[int(np.argmin(archive.value))])


def scatters(archive: Archive, level: int, target: int) -> bool | None:
    """Whether runs at a level scatter; None where nothing is known.

    The target of a ladder is taken to scatter where the level below does: a run there is dear. If
    that one does not, the target still may.
    """
    known = archive.scatter(level)
    if known is None and 0 < level == target and archive.scatter(level - 1):
        return True
    return known


def believed(
    archive: Archive,
    belief: Belief,
    distribution: Distribution,
    z: Array,
    level: int,
    target: int,
) -> tuple[float, float]:
    """Noise-free objective of the recommended design `z` (d,) at a level, and its deviation.

    It is larger than the posterior's: a design that was chosen for its posterior is one in which
    that errs more than elsewhere.
    """
    if len(archive.finished_at(level)) and scatters(archive, level, target) is False:
        return archive.best_at(level)[1], 0.0
    mean, variance = belief.posterior.predict(distribution.to_u(z[None, :]), level)
    return float(mean[0]), OVERCONFIDENCE * float(np.sqrt(variance[0]))


def _centre(archive: Archive, distribution: Distribution, problem: Problem) -> Array:
    """Average (d,) of the distribution's means; the nearest run if it cannot be built.

    Where rankings are in doubt the mean wanders, and its average is better.
    """
    average, to_u = distribution.average, distribution.to_u
    if problem.impossible(problem.to_x(average)) is None:
        return average
    away = to_u(archive.z) - to_u(average)
    return np.asarray(archive.z[int(np.argmin(np.linalg.norm(away, axis=1)))])
