"""The surrogate over levels: one process for the objective and one for each penalty."""

from dataclasses import replace
from typing import Any

import numpy as np

from mfopt.errors import ConfigError
from mfopt.search.surrogate import LEVEL_ARRAYS, Hyperparameters, Observations
from surrogates.gaussian_process import Process, condition
from surrogates.levels_posterior import Failures, LevelsPosterior
from surrogates.map_fit import default, maximise, rougher
from surrogates.training import Rows, rows_of, scaling_of, spread_rows, subset
from surrogates.warp import Warp, warp_of_count, warp_of_objective

FIT_ROWS = 240  # rows for the hyperparameters; the posterior uses all rows
FIRST_ITERATIONS = 12  # from each of two starts, then again
WARM_ITERATIONS = 8
COUNT_ITERATIONS = 6  # also for the share of failed runs
FAILURE_MARGIN = 0.5  # a failed run is this many deviations worse than the worst finished run
UNCHANGED = Warp(1.0, 1.0)  # of shares in [0, 1]


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
        """Learn from all runs; see `mfopt.search.surrogate.Surrogate`."""
        _check_start(observations, start, refit)
        finished = np.isfinite(observations.value)
        z, level = observations.z, observations.level
        smooth = np.array(observations.value)
        smooth[finished] -= observations.counts[finished].sum(axis=1)
        warp = warp_of_objective(smooth[finished], level[finished])
        iterations = FIRST_ITERATIONS if start is None else WARM_ITERATIONS
        rows = rows_of(z[finished], level[finished], smooth[finished])
        main = _fit(rows, warp, start, iterations if refit else 0)
        counts: list[Process | None] = []
        for k, count in enumerate(observations.counts[finished].T):
            if not count.any():
                counts.append(None)
                continue
            own = start.counts[k] if start else None
            rows = rows_of(z[finished], level[finished], count)
            counts.append(_fit(rows, warp_of_count(count), own, COUNT_ITERATIONS if refit else 0))
        failure = None
        if not finished.all():
            own = start.failure if start else None
            rows = rows_of(z, level, np.where(finished, 0.0, 1.0))
            failure = _fit(rows, UNCHANGED, own, COUNT_ITERATIONS if refit else 0)
        return _posterior(observations, main, counts, failure)


def _posterior(
    observations: Observations,
    main: Process,
    counts: list[Process | None],
    failure: Process | None,
) -> LevelsPosterior:
    live = tuple(count for count in counts if count is not None)
    finished = np.isfinite(observations.value)
    value, level = observations.value[finished], observations.level[finished]
    warp = main.warp
    if live:
        warp = warp_of_objective(value, level).compressed(main.hyperparameters.compression)
    learnt = replace(
        main.hyperparameters,
        counts=tuple(count.hyperparameters if count else None for count in counts),
        failure=failure.hyperparameters if failure else None,
    )
    failures = None
    if failure is not None:
        y = warp.forward(value)
        worst = float(y.max() + FAILURE_MARGIN * y.std())
        failures = Failures(failure, worst, worst - float(np.median(y)))
    return LevelsPosterior(learnt, main, live, failures, warp)


def _fit(rows: Rows, warp: Warp, start: Hyperparameters | None, iterations: int) -> Process:
    """Learn hyperparameters in `iterations`, then condition on all rows."""
    scaling = scaling_of(rows, warp)
    hyperparameters = _aligned(start, rows.levels, rows.z.shape[1])
    if iterations:
        chosen = subset(rows, spread_rows(rows, FIT_ROWS))
        starts = [hyperparameters] if start else [hyperparameters, rougher(hyperparameters)]
        hyperparameters = maximise(chosen, scaling, warp, starts, iterations)
    return condition(rows, scaling, warp.compressed(hyperparameters.compression), hyperparameters)


def _aligned(start: Hyperparameters | None, levels: tuple[int, ...], d: int) -> Hyperparameters:
    """`start` for these levels; levels that `start` lacks have the default."""
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
            raise ConfigError("refit = False needs hyperparameters to keep; pass start")
        return
    wanted = (observations.z.shape[1], observations.counts.shape[1])
    given = (start.lengthscales.shape[1], len(start.counts))
    if wanted != given:
        raise ConfigError(
            f"start is for {given[0]} inputs and {given[1]} counts, the observations have "
            f"{wanted[0]} and {wanted[1]}; leave start out"
        )
