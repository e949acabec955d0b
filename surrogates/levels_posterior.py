"""The posterior over levels, combined from one process for each part of the objective."""

from dataclasses import dataclass

import numpy as np

from mfopt.arrays import Array
from mfopt.search.surrogate import Hyperparameters, LeftOut
from surrogates.gaussian_process import Process
from surrogates.warp import NODE_WEIGHTS, NODES, Warp

CERTAIN = 0.25  # smaller expected shares of failures count as 0, because the process oscillates


@dataclass(frozen=True, slots=True, eq=False)
class Failures:
    """The effect of failed runs: the prediction rises with the expected share of failures.

    The smooth part does not see failed runs; otherwise a smooth function would have to fit a cliff.
    """

    process: Process  # of the share
    worst: float  # transformed value of a failed run
    height: float  # rise from the median to `worst`, where all runs fail

    def rise(self, share: Array) -> tuple[Array, Array]:
        """Rise on the transformed scale, and its slope."""
        slope = np.where(share > CERTAIN, self.height / (1.0 - CERTAIN), 0.0)
        return slope * (share - CERTAIN), slope

    def moments(self, z: Array, level: int) -> tuple[Array, Array]:
        """Mean (m,) and variance (m,) of the rise, by Gauss-Hermite quadrature."""
        mean, variance = self.process.mean_variance(z, level)
        rise, _ = self.rise(mean[:, None] + np.sqrt(variance)[:, None] * NODES)
        first = rise @ NODE_WEIGHTS
        return first, (rise - first[:, None]) ** 2 @ NODE_WEIGHTS


@dataclass(frozen=True, slots=True, eq=False)
class LevelsPosterior:
    """Posterior of the objective: a process for its smooth part, each count and the failures.

    The medians of the parts are added, then transformed; the variances follow from the slopes at
    the medians. With the smooth part alone both are exact.
    """

    hyperparameters: Hyperparameters
    main: Process
    counts: tuple[Process, ...]  # of the terms that are not 0 everywhere
    failures: Failures | None
    warp: Warp  # of the whole objective

    def predict(self, z: Array, level: int) -> tuple[Array, Array]:
        """Mean (m,) and variance (m,) of the noise-free objective at `z` (m, d).

        Values above the largest one seen count as that value. The inverse of the transform grows
        exponentially, so the mean of an uncertain prediction would otherwise have no meaning.
        """
        if self.failures is not None:
            centre, spread = self._finished(z, level)
            more, wider = self.failures.moments(z, level)
            seen = sum(float(p.rows.value.max()) for p in (self.main, *self.counts))
            worst = float(self.warp.inverse(np.array(self.failures.worst)))
            return self.warp.moments(centre + more, spread + wider, max(seen, worst))
        seen = float(self.main.rows.value.max())
        mean, variance = self.main.warp.moments(*self.main.mean_variance(z, level), seen)
        for count in self.counts:
            seen = float(count.rows.value.max())
            more, wider = count.warp.moments(*count.mean_variance(z, level), seen, 0.0)
            mean, variance = mean + more, variance + wider
        return mean, variance

    def latent(self, z: Array, level: int) -> tuple[Array, Array]:
        """Mean (m,) and variance (m,) on the transformed scale."""
        mean, variance = self._finished(z, level)
        if self.failures is not None:
            share, wider = self.failures.process.mean_variance(z, level)
            rise, slope = self.failures.rise(share)
            mean, variance = mean + rise, variance + slope**2 * wider
        return mean, variance

    def _finished(self, z: Array, level: int) -> tuple[Array, Array]:
        """Mean (m,) and variance (m,) on the transformed scale of runs that finish."""
        parts = [process.mean_variance(z, level) for process in (self.main, *self.counts)]
        mean, slopes = self._together([part[0] for part in parts])
        spread = [slope**2 * part[1] for slope, part in zip(slopes, parts, strict=True)]
        return mean, np.sum(spread, axis=0)

    def latent_gradient(self, z: Array, level: int) -> tuple[Array, Array]:
        """Mean (m,) on the transformed scale and its gradient (m, d)."""
        parts = [process.mean_gradient(z, level) for process in (self.main, *self.counts)]
        mean, slopes = self._together([part[0] for part in parts])
        turned = [slope[:, None] * part[1] for slope, part in zip(slopes, parts, strict=True)]
        gradient: Array = np.sum(turned, axis=0)
        if self.failures is not None:
            share, ascent = self.failures.process.mean_gradient(z, level)
            rise, slope = self.failures.rise(share)
            mean, gradient = mean + rise, gradient + slope[:, None] * ascent
        return mean, gradient

    def _together(self, means: list[Array]) -> tuple[Array, list[Array]]:
        """The transformed sum of the parts' medians, and the slopes of this sum along the parts."""
        if not self.counts:
            return means[0], [np.ones_like(means[0])]
        processes = (self.main, *self.counts)
        values = [p.warp.inverse(mean) for p, mean in zip(processes, means, strict=True)]
        inner = [1.0 / p.warp.slope(v) for p, v in zip(processes, values, strict=True)]
        for k in range(1, len(values)):
            inner[k] = np.where(values[k] > 0.0, inner[k], 0.0)
            values[k] = np.maximum(values[k], 0.0)
        total = np.sum(values, axis=0)
        outer = self.warp.slope(total)
        return self.warp.forward(total), [outer * slope for slope in inner]

    def sample(self, z: Array, level: int, draws: int, rng: np.random.Generator) -> Array:
        """Joint draws (draws, m) of the noise-free objective at `z` (m, d)."""
        total = self.main.warp.inverse(self.main.sample(z, level, draws, rng))
        for count in self.counts:
            total += np.maximum(count.warp.inverse(count.sample(z, level, draws, rng)), 0.0)
        if self.failures is None:
            return total
        rise, _ = self.failures.rise(self.failures.process.sample(z, level, draws, rng))
        return self.warp.inverse(self.warp.forward(total) + rise)

    def left_out(self) -> LeftOut:
        """Predict each training row from all others, with the same hyperparameters."""
        rows, processes = self.main.rows, (self.main, *self.counts)
        parts = [process.left_out() for process in processes]  # all have the same rows
        mean, slopes = self._together([part[0] for part in parts])
        spread = [slope**2 * part[1] for slope, part in zip(slopes, parts, strict=True)]
        observed, _ = self._together([process.observed for process in processes])
        finished = LeftOut(
            z=rows.z,
            level=np.array(rows.levels, dtype=np.int64)[rows.index],
            failed=np.zeros(len(rows.z), dtype=np.bool_),
            replicates=rows.replicates,
            observed=observed,
            mean=mean,
            variance=np.sum(spread, axis=0),
        )
        return finished if self.failures is None else self._with_failed(finished, self.failures)

    def _with_failed(self, finished: LeftOut, failures: Failures) -> LeftOut:
        """Add the effect of failures to the predictions, and the rows of failed runs."""
        rows = failures.process.rows
        share, wider = failures.process.left_out()
        rise, slope = failures.rise(share)
        wider = slope**2 * wider
        failed_runs = np.bincount(rows.group, rows.value, minlength=len(rows.z)).astype(np.int64)
        some, lost = failed_runs < rows.replicates, failed_runs > 0  # some: same order as finished
        level = np.array(rows.levels, dtype=np.int64)[rows.index][lost]
        mean, variance = np.empty(len(level)), np.empty(len(level))
        for k in np.unique(level):
            own = level == k
            mean[own], variance[own] = self._finished(rows.z[lost][own], int(k))
        return LeftOut(
            z=np.concatenate([finished.z, rows.z[lost]]),
            level=np.concatenate([finished.level, level]),
            failed=np.concatenate([finished.failed, np.ones(len(level), dtype=np.bool_)]),
            replicates=np.concatenate([finished.replicates, failed_runs[lost]]),
            observed=np.concatenate([finished.observed, np.full(len(level), failures.worst)]),
            mean=np.concatenate([finished.mean + rise[some], mean + rise[lost]]),
            variance=np.concatenate([finished.variance + wider[some], variance + wider[lost]]),
        )

    def noise_variance(self, level: int) -> float:
        """Variance of one run on the transformed scale, on average over the training rows."""
        processes = (self.main, *self.counts)
        rows = self.main.rows
        _, slopes = self._together([process.mean(rows.z, level) for process in processes])
        noise = [
            float(np.mean(slope**2)) * process.noise_variance(level)
            for slope, process in zip(slopes, processes, strict=True)
        ]
        return sum(noise)

    def transform(self, value: Array) -> Array:
        """Objective to transformed scale."""
        return self.warp.forward(value)

    def inverse(self, transformed: Array) -> Array:
        """Transformed scale to objective."""
        return self.warp.inverse(transformed)
