"""Which candidates of a generation are run again, and what follows from their replicates.

`UncertaintyHandling` measures by few replicates how far noise changes ranks, and adapts the number
of runs of every candidate. `EliteDoubt` runs again only those candidates of which it is uncertain
that they belong to the elite, as long as that decides more of the ranking than new candidates.

Source: Hansen, Niederberger, Guzzella & Koumoutsakos, IEEE TEC 13 (2009) 180,
doi:10.1109/TEVC.2008.924423 (uncertainty handling, theirs is the notation).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from mfopt.arrays import Array, IntArray
from mfopt.search.noise_share import Belief, NoiseShare, belief
from mfopt.search.ranking import certainty, expected_weights

Runs = Sequence[Sequence[float]]  # values of each candidate of a generation, in the order asked

THETA = 0.2  # tolerated share of the possible rank changes
ALPHA_T = 1.5  # by which the number of runs of a candidate grows and shrinks
MOST_RUNS = 10  # of a candidate; the paper leaves the longest measurement to the user

ENOUGH = 4.0  # replicates, older ones counting less, that the noise is judged by
PROBES = 2  # replicates that a generation adds to them at most, whatever they gain
IN_DOUBT = 0.05  # probability of belonging to the elite, or not, below which there is no doubt
NODES, NODE_WEIGHTS = np.polynomial.hermite_e.hermegauss(3)  # for the outcome of a replicate


@dataclass(frozen=True, slots=True, eq=False)
class Settled:
    """The end of a generation."""

    ranks: Array  # (n,) of the candidates, 0 the best
    after: "Reevaluation"  # for the next generation
    sigma_factor: float = 1.0  # by which the step size must grow


class Reevaluation(Protocol):
    """A rule for replicates. It is asked whenever all runs of a generation have ended."""

    def wanted(self, runs: Runs, noise: NoiseShare, left: int) -> list[int]:
        """Positions of the candidates to run again, at most `left`; none settles it."""

    def settled(self, runs: Runs, noise: NoiseShare) -> Settled:
        """The ranking, once no replicate is wanted; `noise` knows this generation too."""


@dataclass(frozen=True, slots=True)
class NoReplicates:
    """Every candidate is run once."""

    def wanted(self, runs: Runs, noise: NoiseShare, left: int) -> list[int]:
        """None."""
        return []

    def settled(self, runs: Runs, noise: NoiseShare) -> Settled:
        """Rank by the values."""
        return Settled(_ranks(np.array([r[0] for r in runs])), self)


@dataclass(frozen=True, slots=True)
class UncertaintyHandling:
    """The method of Hansen et al. 2009; a candidate's number of runs is its measurement length."""

    dimension: int
    length: float = 1.0  # runs of a candidate
    owed: float = 0.0  # share of a re-evaluated candidate left over from the last generation

    def wanted(self, runs: Runs, noise: NoiseShare, left: int) -> list[int]:
        """All candidates up to `length` runs, and the first few as often once more."""
        if any(len(r) > 1 for r in runs):
            return []
        n, again = len(runs), int(self._again(len(runs)))
        most = max(1, (left + n) // (n + again))  # what is left allows so many runs of each
        length = min(int(self.length), most)
        return (list(range(n)) * (length - 1) + list(range(again)) * length)[:left]

    def settled(self, runs: Runs, noise: NoiseShare) -> Settled:
        """Rank by the sum of both ranks; lengthen or shorten the measurement (algorithm 4)."""
        length = min(len(r) for r in runs)
        again = [i for i, r in enumerate(runs) if len(r) > length]
        old = np.array([np.mean(r[:length]) for r in runs])
        new = np.array([np.mean(r[length:] if len(r) > length else r) for r in runs])
        owed = self._again(len(runs)) % 1.0
        if not again:
            return Settled(_ranks(old), replace(self, owed=owed))
        change, s = uncertainty(old, new, again)
        ranks = _ranks_of_sums(old, new, change, again)
        if s <= 0.0:
            shorter = max(self.length / ALPHA_T, 1.0) if s < 0.0 else self.length
            return Settled(ranks, replace(self, length=shorter, owed=owed))
        if self.length < MOST_RUNS:
            longer = min(self.length * ALPHA_T, float(MOST_RUNS))
            return Settled(ranks, replace(self, length=longer, owed=owed))
        return Settled(ranks, replace(self, owed=owed), 1.0 + 2.0 / (self.dimension + 10.0))

    def _again(self, n: int) -> float:
        """Candidates to re-evaluate, lambda_reev; the paper rounds at random, here in turn."""
        return max(0.1 * n, 2.0) + self.owed


def uncertainty(old: Array, new: Array, again: Sequence[int]) -> tuple[Array, float]:
    """Rank changes Delta (n,) and the uncertainty s, positive where noise must be treated.

    Args:
        old: (n,) values.
        new: (n,) values of the second measurement, `old` where there is none.
        again: positions measured a second time.
    """
    rank_old, rank_new = _joint_ranks(old, new)
    apart = rank_old - rank_new
    change = np.abs(apart - np.sign(apart))
    s = [
        2.0 * change[i]
        - _limit(rank_new[i] - (new[i] > old[i]), len(old))
        - _limit(rank_old[i] - (old[i] > new[i]), len(old))
        for i in again
    ]
    return change, float(np.mean(s))


def _limit(rank: float, n: int) -> float:
    """Rank change that is tolerated at a rank: a quantile of all that are possible there."""
    possible = np.abs(np.arange(1, 2 * n) - rank)
    return float(np.percentile(possible, 50.0 * THETA, method="hazen"))


def _joint_ranks(old: Array, new: Array) -> tuple[Array, Array]:
    ranks = _ranks(np.concatenate([old, new])) + 1.0
    return ranks[: len(old)], ranks[len(old) :]


def _ranks_of_sums(old: Array, new: Array, change: Array, again: Sequence[int]) -> Array:
    """Ranks by the sum of both ranks, ties by the smaller rank change, then by the mean value."""
    settled = np.full(len(old), np.mean(change[list(again)]))
    settled[list(again)] = change[list(again)]
    order = np.lexsort((old + new, settled, np.add(*_joint_ranks(old, new))))
    return np.argsort(order).astype(float)


def _ranks(values: Array) -> Array:
    return np.argsort(np.argsort(values, kind="stable")).astype(float)


@dataclass(frozen=True, slots=True)
class EliteDoubt:
    """Replicates of candidates whose membership in the elite is uncertain, where they pay.

    Progress of a generation follows the certainty of its ranking, and costs all its runs. A
    replicate pays while it raises certainty per run: it must add more than the generation's runs
    have brought on average, which is what a new candidate would bring.
    """

    def wanted(self, runs: Runs, noise: NoiseShare, left: int) -> list[int]:
        """First probes where the noise is not known well, then what pays, some at a time."""
        n, made = len(runs), sum(len(r) for r in runs)
        if made == n:
            probes = min(PROBES, int(np.ceil(ENOUGH - noise.aged.freedom)), left)
            if probes > 0:
                return list(range(probes))
        now = belief(runs, noise.after(runs).share)
        at_most = min(n // 4 + 1, 2 * n - made, left)  # as many replicates as candidates
        gain = gains(now, np.flatnonzero(in_doubt(now)))
        pays = [i for i in np.argsort(-gain, kind="stable") if gain[i] * made > now.certainty]
        return [int(i) for i in pays[: max(0, at_most)]]

    def settled(self, runs: Runs, noise: NoiseShare) -> Settled:
        """Rank by the believed values."""
        return Settled(_ranks(belief(runs, noise.share).mean), self)


def in_doubt(now: Belief) -> Array:
    """Whether (n,) a candidate may belong to the better half or not."""
    ranks = np.argsort(np.argsort(now.draws(), axis=1), axis=1)
    member = np.mean(ranks < len(now.mean) // 2, axis=0)
    return np.asarray(np.minimum(member, 1.0 - member) > IN_DOUBT)


def gains(now: Belief, which: IntArray) -> Array:
    """Certainty (n,) that one more run of a candidate is expected to add, 0 if not of `which`.

    The run would move the belief by a normal amount and narrow it; the outcomes are
    integrated with Gauss-Hermite nodes.
    """
    draws = now.draws()
    before = certainty(expected_weights(draws))
    left = now.variance_after_replicate()
    gained = np.zeros(len(now.mean))
    for i in which[now.variance[which] > 0.0]:
        standard = (draws[:, i] - now.mean[i]) / np.sqrt(now.variance[i])
        for node, weight in zip(NODES, NODE_WEIGHTS / NODE_WEIGHTS.sum(), strict=True):
            moved = draws.copy()
            mean = now.mean[i] + node * np.sqrt(now.variance[i] - left[i])
            moved[:, i] = mean + np.sqrt(left[i]) * standard
            gained[i] += weight * (certainty(expected_weights(moved)) - before)
    return gained
