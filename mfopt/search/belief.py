"""What the surrogate believes around the sampling distribution, and what it was taught there."""

from dataclasses import dataclass

import numpy as np

from mfopt.arrays import Array, IntArray
from mfopt.search.archive import Archive
from mfopt.search.distribution import Distribution
from mfopt.search.surrogate import (
    Hyperparameters,
    Observations,
    Posterior,
    Surrogate,
    left_after_run,
)

ROWS = 12  # per variable, at the working level and above
ROWS_BELOW = 8  # per variable, at each lower level
FURTHEST = 5.0  # rows further from the mean teach nothing of the neighbourhood [sqrt(d)]
NEARBY = 3.0  # what counts as the neighbourhood [sqrt(d)]
REFIT_GROWTH = 1.1  # hyperparameters are learnt anew when there are so many times the runs
FEWEST = 3  # finished runs to learn anything from


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """A surrogate taught with the runs nearest to the distribution, in its coordinates."""

    posterior: Posterior
    z: Array  # (n, d) distinct designs that finished, unit cube
    u: Array  # (n, d) the same in the distribution's coordinates
    runs_at_fit: int  # runs in the archive when the hyperparameters were learnt

    def best(
        self,
        level: int,
        fewest: int,
        centre: tuple[Array, Array],
        among: Array | None = None,
    ) -> Array:
        """The nearby design (d,) that is best at a level: the centre, or a run that beats it.

        The doubt of a run counts against it, because the lowest of many doubtful means is luck.
        That of the centre, which is but one, counts as far as a run would settle it. So under much
        noise the centre is chosen, without noise a run.

        Args:
            fewest: so many of the nearest count as nearby, however far they are.
            centre: a design (d,) of the unit cube, and the same in the distribution's coordinates.
            among: designs (m, d) to choose from, as far as they are known here.
        """
        z, u = np.vstack([self.z, centre[0]]), np.vstack([self.u, centre[1]])
        chosen = np.arange(len(z))
        if among is not None:
            known = (z[:, None, :] == among).all(axis=2).any(axis=1)
            chosen = np.flatnonzero(known) if known.any() else chosen
        away = np.linalg.norm(u[chosen], axis=1)
        last = np.sort(away)[min(len(away), fewest) - 1]
        near = chosen[away <= max(NEARBY * np.sqrt(u.shape[1]), last)]
        mean, variance = self.posterior.latent(u[near], level)
        settled = variance - left_after_run(self.posterior, variance, level)
        doubt = np.sqrt(np.where(near == len(self.z), settled, variance))
        return np.asarray(z[near[np.argmin(mean + doubt)]])

    def ranked(self, level: int) -> Array:
        """The designs (n, d) by their predicted value at a level, doubt counted against them."""
        mean, variance = self.posterior.latent(self.u, level)
        return np.asarray(self.z[np.argsort(mean + np.sqrt(variance), kind="stable")])


def learn(
    archive: Archive,
    distribution: Distribution,
    surrogate: Surrogate,
    before: Belief | None,
    *,
    working: int,
    lowest: int,
) -> Belief | None:
    """Teach the surrogate the neighbourhood of the distribution.

    Args:
        before: the last belief; its hyperparameters are kept until there are enough new runs.
        working: level that the search works at.
        lowest: levels below this one are not to be trusted.

    Returns:
        None where too few runs have finished.
    """
    u = distribution.to_u(archive.z)
    rows = _nearest(archive, u, working, lowest)
    finished = rows[np.isfinite(archive.value[rows])]
    if len(finished) < FEWEST:
        return None
    observations = Observations(
        u[rows], archive.level[rows], archive.value[rows], archive.counts[rows]
    )
    start, at_fit = _start(before, archive.level[finished]), 0
    if before is not None and start is not None:
        at_fit = before.runs_at_fit
    refit = len(archive) >= REFIT_GROWTH * at_fit + 1
    posterior = surrogate.fit(observations, start, refit)
    _, first = np.unique(archive.z[finished], axis=0, return_index=True)
    distinct = finished[np.sort(first)]
    return Belief(posterior, archive.z[distinct], u[distinct], len(archive) if refit else at_fit)


def _nearest(archive: Archive, u: Array, working: int, lowest: int) -> IntArray:
    """Rows to learn from: the nearest of each level, none that lies far outside."""
    d = u.shape[1]
    away = np.linalg.norm(u, axis=1)
    limit = max(FURTHEST * np.sqrt(d), np.sort(away)[min(len(away) - 1, 2 * d)])
    rows: list[int] = []
    for level in np.unique(archive.level[archive.level >= lowest]):
        own = np.flatnonzero((archive.level == level) & (away <= limit))
        most = (ROWS if level >= working else ROWS_BELOW) * d
        rows.extend(own[np.argsort(away[own], kind="stable")[:most]])
    return np.sort(np.array(rows, dtype=np.int64))


def _start(before: Belief | None, level: IntArray) -> Hyperparameters | None:
    """Hyperparameters to begin with, if they fit the levels of the finished runs."""
    if before is None:
        return None
    start = before.posterior.hyperparameters
    return start if start.levels == tuple(np.unique(level).tolist()) else None
