"""What replicates say of the noise, and what is believed of the candidates of a generation.

Everything is judged on normal scores of the runs' ranks within their generation, as CMA-ES itself
uses ranks alone: outliers weigh little, and the share of noise can be pooled over generations
whose values have other scales. Replicates of one candidate use other simulation seeds than its
first run, so an effect that all candidates share on a seed counts as noise, if anything too much.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from mfopt.arrays import Array
from mfopt.search.ranking import certainty, expected_weights

DECAY = 0.9  # weight of a generation's replicates in the next
MOST_NOISE = 0.99  # a generation always says a little
DRAWS = 200  # of the scores that a generation may have
MAD_TO_DEVIATION = 1.4826  # of a normal distribution


@dataclass(frozen=True, slots=True)
class NoiseShare:
    """Share of the noise in the variance that a generation's own normal scores have, pooled."""

    squares: float = 0.0  # sum of squares within candidates, in variances of the generation
    freedom: float = 0.0  # degrees of freedom

    @property
    def share(self) -> float:
        """Between 0 and `MOST_NOISE`; 0 as long as there was no replicate."""
        return min(self.squares / self.freedom, MOST_NOISE) if self.freedom > 0.0 else 0.0

    @property
    def aged(self) -> "NoiseShare":
        """What it is worth in the next generation."""
        return NoiseShare(DECAY * self.squares, DECAY * self.freedom)

    def after(self, runs: Sequence[Sequence[float]]) -> "NoiseShare":
        """With the replicates of one more generation."""
        scores = _scores(runs)
        variance = float(np.var(np.concatenate(scores)))
        if variance == 0.0:
            return self.aged
        squares = sum(float(np.sum((s - s.mean()) ** 2)) for s in scores) / variance
        freedom = sum(len(s) - 1 for s in scores)
        return NoiseShare(self.aged.squares + squares, self.aged.freedom + freedom)


@dataclass(frozen=True, slots=True, eq=False)
class Belief:
    """Normal beliefs of the noise-free scores of a generation's candidates."""

    mean: Array  # (n,)
    variance: Array  # (n,)
    noise_variance: float  # of one run

    def draws(self) -> Array:
        """Draws (DRAWS, n) from the same random numbers at every call, so that beliefs compare."""
        standard = np.random.default_rng(0).standard_normal((DRAWS, len(self.mean)))
        return np.asarray(self.mean + np.sqrt(self.variance) * standard)

    def variance_after_replicate(self) -> Array:
        """Variance (n,) of each if it alone is run once more."""
        known = self.variance + self.noise_variance
        return np.divide(
            self.variance * self.noise_variance, known, out=np.zeros_like(known), where=known > 0
        )

    @property
    def certainty(self) -> float:
        """Of the ranking."""
        return certainty(expected_weights(self.draws()))


def belief(runs: Sequence[Sequence[float]], share: float) -> Belief:
    """Belief from the runs of a generation, drawn towards its mean as far as noise demands."""
    scores = _scores(runs)
    variance = float(np.var(np.concatenate(scores)))
    means = np.array([s.mean() for s in scores])
    trust = _trust(runs, share)
    noise = share * variance
    left = trust * noise / [len(r) for r in runs]
    return Belief(means.mean() + trust * (means - means.mean()), left, noise)


def believed_values(runs: Sequence[Sequence[float]], share: float) -> tuple[Array, Array]:
    """Means and deviations (n,) of the noise-free objective; infinite where a run failed."""
    means = np.array([np.mean(r) for r in runs])
    good = means[np.isfinite(means)]
    if not good.size:
        return means, np.zeros(len(means))
    centre = np.median(good)
    deviation = MAD_TO_DEVIATION * np.median(np.abs(good - centre))
    trust = _trust(runs, share)
    counts = np.array([len(r) for r in runs])
    return centre + trust * (means - centre), deviation * np.sqrt(trust * share / counts)


def _trust(runs: Sequence[Sequence[float]], share: float) -> Array:
    """Signal over signal and noise (n,) of the candidates' means."""
    counts = np.array([len(r) for r in runs])
    return np.asarray((1.0 - share) / (1.0 - share + share / counts))


def _scores(runs: Sequence[Sequence[float]]) -> list[Array]:
    """Normal scores of all runs, by candidate; equal values share theirs."""
    every = np.concatenate([np.asarray(r, dtype=float) for r in runs])
    _, place, times = np.unique(every, return_inverse=True, return_counts=True)
    ranks = (np.cumsum(times) - (times - 1) / 2.0)[place]  # from 1
    scores = ndtri((ranks - 0.5) / len(every))
    return [np.asarray(s) for s in np.split(scores, np.cumsum([len(r) for r in runs])[:-1])]
