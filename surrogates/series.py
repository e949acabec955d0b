"""Emulator of whole time series: from the parameters of a simulation to what it gives over time.

The series of all runs, one row y (p,) a run, are standardised point by point and reduced to
principal components. Each score is a Gaussian process of the parameters:

    y(x) = m + s (W t(x) + e),    t_j ~ GP(0, constant * Matern + noise_j)

e is what differs between runs with equal parameters (the packing): its covariance comes from the
residuals of leave-one-out predictions and from replicates. Weak components are smoothed over
time, so that the mean has no jitter of single runs.

Source: Higdon, Gattiker, Williams & Rightley 2008, doi:10.1198/016214507000000888.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from mfopt.arrays import Array, frozen
from mfopt.errors import ConfigError
from surrogates.effects import EffectProcesses, Runs, fit_effects
from surrogates.scores import ScoreProcesses, fit_scores

MOST_COMPONENTS = 14
EXPLAINED = 0.999999  # of the variance over the runs, by the components that are kept
SMOOTHING = 1.0  # [points] of weak components over time
WEAK = 0.01  # of the variance: below, a component has the jitter of single runs
FLAT = 1e-9  # [of the largest deviation] points that vary less hardly vary
FEWEST_RUNS = 8


@dataclass(frozen=True, slots=True, eq=False)
class SeriesEmulator:
    """What a simulation gives at parameters z (d,) in the unit cube."""

    mean: Array  # (p,)
    scale: Array  # (p,)
    components: Array  # (k, p), orthonormal
    scores: ScoreProcesses
    noise: Array  # (k, k) covariance of the scores of one run about their mean
    beyond: Array  # (n, p) what each run has beyond the components, standardised

    def project(self, y: Array) -> Array:
        """Scores (..., k) of series (..., p)."""
        return np.asarray((y - self.mean) / self.scale @ self.components.T)

    def predict(self, z: Array) -> tuple[Array, Array]:
        """Mean and variance of the mean scores (n, k) at parameters (n, d)."""
        return self.scores.predict(z)

    def series(self, scores: Array) -> Array:
        """Series (..., p) of scores (..., k)."""
        return np.asarray(self.mean + self.scale * (scores @ self.components))

    def scatter(self) -> Array:
        """Standard deviation (p,) of a run about its mean, in the unit of the series."""
        within = np.einsum("kp,kl,lp->p", self.components, self.noise, self.components)
        return np.asarray(self.scale * np.sqrt(within + np.mean(self.beyond**2, axis=0)))


def fit_series(z: Array, y: Array, blocks: Sequence[int]) -> SeriesEmulator:
    """Learn from runs.

    Args:
        z: parameters (n, d) in the unit cube; equal rows are replicates.
        y: series (n, p), one after the other in a row.
        blocks: number of points of each series, in that order.

    Raises:
        ConfigError: if there are fewer than 8 runs.
    """
    return _learned(z, y, blocks, lambda scores: fit_scores(z, scores))


def fit_effect_series(
    runs: Runs, y: Array, blocks: Sequence[int], most: int = MOST_COMPONENTS
) -> SeriesEmulator:
    """Learn from runs (n, p) with effects; its `scores`, at most so many, are `EffectProcesses`.

    Raises:
        ConfigError: if there are fewer than 8 runs.
    """
    places = np.column_stack([runs.z, runs.effect, runs.strength])
    return _learned(places, y, blocks, lambda scores: fit_effects(runs, scores), most)


def with_effects(its: SeriesEmulator, effects: Sequence[int]) -> SeriesEmulator:
    """The emulator of series with these effects; their strengths follow the base parameters."""
    assert isinstance(its.scores, EffectProcesses)
    return replace(its, scores=its.scores.having(effects))


def _learned(
    z: Array,
    y: Array,
    blocks: Sequence[int],
    learn: Callable[[Array], ScoreProcesses],
    most: int = MOST_COMPONENTS,
) -> SeriesEmulator:
    """An emulator of series (n, p) whose scores `learn` learns; z (n, ...) tells replicates."""
    if len(z) < FEWEST_RUNS:
        raise ConfigError(
            f"{len(z)} finished runs are too few to learn from; at least {FEWEST_RUNS} are needed: "
            "allow more runs, or widen the ranges away from where the simulation fails"
        )
    mean = y.mean(axis=0)
    scale = _scales(y, blocks)
    standard = (y - mean) / scale
    components = _components(standard, blocks, most)
    scores = standard @ components.T
    processes = learn(scores)
    noise = _noise(z, scores, processes)
    beyond = standard - scores @ components
    return SeriesEmulator(
        frozen(mean), frozen(scale), frozen(components), processes, frozen(noise), frozen(beyond)
    )


def _scales(y: Array, blocks: Sequence[int]) -> Array:
    """One scale for each series: a point that hardly varies gets no weight of its own."""
    scales = []
    for part in np.split(y, np.cumsum(blocks)[:-1], axis=1):
        spread = float(np.sqrt(part.var(axis=0).mean()))
        size = float(np.abs(part).max())
        scales.append(np.full(part.shape[1], max(spread, FLAT * size) or 1.0))
    return np.concatenate(scales)


def _components(standard: Array, blocks: Sequence[int], at_most: int) -> Array:
    """At most so many orthonormal rows (k, p), smooth over time; one if nothing varies."""
    from sklearn.decomposition import PCA  # a second, which only this needs

    points = standard.shape[1]
    if not standard.any():
        return np.full((1, points), 1.0 / np.sqrt(points))
    most = min(at_most, len(standard) - 1, points)
    pca = PCA(n_components=most, svd_solver="full").fit(standard)
    explained = np.cumsum(pca.explained_variance_ratio_)
    kept = pca.components_[: 1 + int(np.searchsorted(explained, EXPLAINED))].copy()
    weak = pca.explained_variance_ratio_[: len(kept)] < WEAK
    for part in np.split(kept, np.cumsum(blocks)[:-1], axis=1):  # views
        part[weak] = gaussian_filter1d(part[weak], SMOOTHING, axis=1, mode="nearest")
    q, r = np.linalg.qr(kept.T)
    return np.asarray((q * np.sign(np.diag(r))).T)


def _noise(z: Array, scores: Array, processes: ScoreProcesses) -> Array:
    """Covariance (k, k) of scores between runs with equal parameters.

    The variances are those that the processes found, or those of replicates where they are larger;
    the correlations are those of the leave-one-out residuals, shrunk.
    """
    from sklearn.covariance import ledoit_wolf

    residuals = processes.left_out(scores) - scores
    shrunk = ledoit_wolf(residuals)[0]
    deviation = np.sqrt(np.diag(shrunk))
    still = deviation == 0.0  # scores that never vary correlate with nothing
    deviation[still] = 1.0
    correlation = shrunk / np.outer(deviation, deviation) + np.diag(1.0 * still)
    variance = np.array(processes.noise)
    pairs = _within(z, scores)
    if len(pairs) >= FEWEST_RUNS // 2:
        variance = np.maximum(variance, np.mean(pairs**2, axis=0))
    return np.asarray(correlation * np.sqrt(np.outer(variance, variance)))


def _within(z: Array, values: Array) -> Array:
    """Deviations of replicates from their own mean, scaled so that they have a run's variance.

    Where no parameters repeat: the values themselves.
    """
    _, which = np.unique(z, axis=0, return_inverse=True)
    deviations = []
    for group in range(which.max() + 1):
        rows = values[which.ravel() == group]
        if len(rows) > 1:
            factor = np.sqrt(len(rows) / (len(rows) - 1))
            deviations.append(factor * (rows - rows.mean(axis=0)))
    return np.concatenate(deviations) if deviations else values
