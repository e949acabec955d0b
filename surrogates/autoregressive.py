"""The surrogate over levels: the objective's process beside one for each soft constraint."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mfopt.arrays import Array
from mfopt.errors import ConfigError
from mfopt.surrogate import LEVEL_ARRAYS, Hyperparameters, LeftOut, Observations
from surrogates.gaussian_process import Process, condition
from surrogates.map_fit import default, maximise, rougher
from surrogates.training import Rows, rows_of, scaling_of, spread_rows, subset
from surrogates.warp import Warp, warp_of_count, warp_of_objective

FIT_ROWS = 300  # rows that the hyperparameters are learnt from; all are conditioned on
FIRST_ITERATIONS = 12  # from each of two starts, then again
WARM_ITERATIONS = 8
COUNT_ITERATIONS = 6


@dataclass(frozen=True, slots=True, eq=False)
class LevelsPosterior:
    """Posterior of the objective: a process for its smooth part, one for each count.

    On the transformed scale the parts are put together at their medians, and their variances by
    the slopes there; without counts both are exact.
    """

    hyperparameters: Hyperparameters
    main: Process
    counts: tuple[Process, ...]  # of the terms that are not 0 everywhere
    warp: Warp  # of the whole objective

    def predict(self, z: Array, level: int) -> tuple[Array, Array]:
        """Mean (m,) and variance (m,) of the noise-free objective at `z` (m, d)."""
        mean, variance = self.main.warp.moments(*self.main.mean_variance(z, level))
        for count in self.counts:
            more, wider = count.warp.moments(*count.mean_variance(z, level), floor=0.0)
            mean, variance = mean + more, variance + wider
        return mean, variance

    def latent(self, z: Array, level: int) -> tuple[Array, Array]:
        """Mean (m,) and variance (m,) on the transformed scale."""
        parts = [process.mean_variance(z, level) for process in (self.main, *self.counts)]
        mean, slopes = self._together([part[0] for part in parts])
        spread = [slope**2 * part[1] for slope, part in zip(slopes, parts, strict=True)]
        return mean, np.sum(spread, axis=0)

    def latent_gradient(self, z: Array, level: int) -> tuple[Array, Array]:
        """Mean (m,) on the transformed scale and its gradient (m, d)."""
        parts = [process.mean_gradient(z, level) for process in (self.main, *self.counts)]
        mean, slopes = self._together([part[0] for part in parts])
        turned = [slope[:, None] * part[1] for slope, part in zip(slopes, parts, strict=True)]
        return mean, np.sum(turned, axis=0)

    def _together(self, means: list[Array]) -> tuple[Array, list[Array]]:
        """Transform the sum of the parts' medians; also its slopes along the parts."""
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
        return total

    def left_out(self) -> LeftOut:
        """Predict each training row from all others, hyperparameters unchanged."""
        rows = self.main.rows
        parts = [self.main.left_out()]
        observed = [self.main.observed]
        for count in self.counts:  # their rows are the finished ones, in the same order
            mean, variance, seen = (np.zeros(len(rows.z)) for _ in range(3))
            mean[~rows.failed], variance[~rows.failed] = count.left_out()
            seen[~rows.failed] = count.observed
            if rows.failed.any():
                for k, level in enumerate(rows.levels):
                    lost = rows.failed & (rows.index == k)
                    mean[lost], variance[lost] = count.mean_variance(rows.z[lost], level)
            parts.append((mean, variance))
            observed.append(seen)
        mean, slopes = self._together([part[0] for part in parts])
        spread = [slope**2 * part[1] for slope, part in zip(slopes, parts, strict=True)]
        return LeftOut(
            z=rows.z,
            level=np.array(rows.levels, dtype=np.int64)[rows.index],
            failed=rows.failed,
            replicates=rows.replicates,
            observed=self._together(observed)[0],
            mean=mean,
            variance=np.sum(spread, axis=0),
        )

    def noise_variance(self, level: int) -> float:
        """Variance of one run on the transformed scale, on average over the training rows."""
        processes = (self.main, *self.counts)
        rows = self.main.rows
        z = rows.z[~rows.failed]
        _, slopes = self._together([process.mean(z, level) for process in processes])
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


class AutoregressiveGp:
    """Gaussian processes over levels, f_l = rho_l f_(l-1) + difference_l.

    Source: Kennedy & O'Hagan, Biometrika 87 (2000), 1-13.
    """

    def fit(
        self,
        observations: Observations,
        start: Hyperparameters | None = None,
        refit: bool = True,
    ) -> LevelsPosterior:
        """Learn from all runs; see `mfopt.surrogate.Surrogate`."""
        _check_start(observations, start, refit)
        finished = np.isfinite(observations.value)
        z, level = observations.z, observations.level
        smooth = np.array(observations.value)
        smooth[finished] -= observations.counts[finished].sum(axis=1)
        warp = warp_of_objective(smooth[finished], level[finished])
        iterations = FIRST_ITERATIONS if start is None else WARM_ITERATIONS
        main = _fit(rows_of(z, level, smooth), warp, start, iterations if refit else 0)
        counts: list[Process | None] = []
        for k, count in enumerate(observations.counts[finished].T):
            if not count.any():
                counts.append(None)
                continue
            own = start.counts[k] if start else None
            rows = rows_of(z[finished], level[finished], count)
            counts.append(_fit(rows, warp_of_count(count), own, COUNT_ITERATIONS if refit else 0))
        return _posterior(observations, main, counts)


def _posterior(
    observations: Observations, main: Process, counts: list[Process | None]
) -> LevelsPosterior:
    live = tuple(count for count in counts if count is not None)
    learnt = tuple(count.hyperparameters if count else None for count in counts)
    warp = main.warp
    if live:
        finished = np.isfinite(observations.value)
        warp = warp_of_objective(observations.value[finished], observations.level[finished])
        warp = warp.compressed(main.hyperparameters.compression)
    return LevelsPosterior(replace(main.hyperparameters, counts=learnt), main, live, warp)


def _fit(rows: Rows, warp: Warp, start: Hyperparameters | None, iterations: int) -> Process:
    """Learn hyperparameters in so many iterations, then condition on all rows."""
    scaling = scaling_of(rows, warp)
    hyperparameters = _aligned(start, rows.levels, rows.z.shape[1])
    if iterations:
        chosen = subset(rows, spread_rows(rows, FIT_ROWS))
        starts = [hyperparameters] if start else [hyperparameters, rougher(hyperparameters)]
        hyperparameters = maximise(chosen, scaling, warp, starts, iterations)
    return condition(rows, scaling, warp.compressed(hyperparameters.compression), hyperparameters)


def _aligned(start: Hyperparameters | None, levels: tuple[int, ...], d: int) -> Hyperparameters:
    """`start` for these levels; a level that it lacks has the default."""
    result = default(levels, d)
    if start is None:
        return result
    to = [k for k, level in enumerate(levels) if level in start.levels]
    of = [start.levels.index(levels[k]) for k in to]
    changed: dict[str, Any] = {}
    for name in LEVEL_ARRAYS:
        changed[name] = np.array(getattr(result, name))
        changed[name][to] = getattr(start, name)[of]
    changed["rho"][0] = 0.0
    return replace(result, compression=start.compression, **changed)


def _check_start(observations: Observations, start: Hyperparameters | None, refit: bool) -> None:
    if start is None:
        if not refit:
            raise ConfigError("refit is off without hyperparameters to keep; pass start")
        return
    wanted = (observations.z.shape[1], observations.counts.shape[1])
    given = (start.lengthscales.shape[1], len(start.counts))
    if wanted != given:
        raise ConfigError(
            f"start is for {given[0]} inputs and {given[1]} counts, the observations have "
            f"{wanted[0]} and {wanted[1]}; begin without start"
        )
