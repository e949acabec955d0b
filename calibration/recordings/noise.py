"""Measurement noise, told apart from scatter between repeats by how fast they change.

Measurement noise changes from sample to sample. Repeats of a granular experiment also differ by the
packing of the grains: slowly, over all of the run. The first is what is left around a smooth trend
of each repeat; the second is how these trends differ.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.stats import chi2

from calibration.recordings.agreement import best_shift, roughness
from calibration.recordings.case import Known
from calibration.recordings.records import Noise, Recording, Series
from calibration.recordings.trend import (
    Basis,
    Fit,
    Group,
    design,
    fit,
    information,
    restricted,
)
from mfopt.arrays import Array, BoolArray
from mfopt.errors import ConfigError

FEWEST = 8  # samples of a repeat; fewer tell nothing of noise
MOST_FUNCTIONS = 250
SAMPLES_PER_FUNCTION = 4
OWN = (4, 6, 9, 13)  # spline functions of a deviation
REST = 4  # equal extreme values in a row: rest or saturation, without noise
SHORTEST = 0.2  # autocorrelation time in steps; e^-5 is no correlation
TAUS, NEAR = 21, 4.0  # autocorrelation times tried for the interval, up to so many times the best
INTERVAL = (0.95, 0.05)  # quantiles, of a 90 % interval


@dataclass(frozen=True, slots=True, eq=False)
class _Model:
    """A group with the trend that suits it best."""

    group: Group
    basis: Basis
    quantum: float

    @property
    def slowest(self) -> float:
        """Longest autocorrelation time of noise [s]: the distance of knots; slower is trend."""
        begin, end = self.group.span
        functions = self.basis.own if len(self.group.times) > 1 else self.basis.shared
        return (end - begin) / (functions - 3)


def measurement_noise(recordings: Sequence[Recording], channel: str, known: Known) -> Noise:
    """Noise of a channel, the same in all recordings.

    Args:
        recordings: in which the channel may be.
        channel: name.
        known: what the case file says. A stated noise is taken as it is, unless repeats show more;
            the offset is no noise.

    Raises:
        ConfigError: if no recording has the channel, or all have fewer than 8 samples and no noise
            is stated.
    """
    models = [_model(group, quantum) for group, quantum in _groups(recordings, channel)]
    if known.noise is not None:
        return _at_least(known.noise, channel, models)
    if not models:
        raise ConfigError(
            f"no recording has {FEWEST} samples of {channel} in motion, so its noise "
            f"cannot be found; state noise in [measurement.{channel}]"
        )
    repeated = _repeated(models)
    found = _found(channel, repeated or models)
    if repeated:
        return found
    rough, coarse = _bounds(models)
    floor, (low, high) = _floor(models), found.sigma_range
    bounds = (max(min(low, rough), floor), max(high, coarse))
    return replace(found, sigma_range=bounds, found="bounded from one recording")


def _at_least(stated: float, channel: str, models: Sequence[_Model]) -> Noise:
    """The stated noise, or that of the repeats if it is larger beyond doubt."""
    if repeated := _repeated(models):
        found = _found(channel, repeated)
        if found.sigma_range[0] > stated:
            return replace(found, found=f"{found.found}, more than the {stated:g} stated")
    tau = _best_tau(models)[0] if models else 0.0
    return Noise(channel, stated, tau, (stated, stated), "stated")


def _repeated(models: Sequence[_Model]) -> list[_Model]:
    return [model for model in models if len(model.group.times) > 1]


def _found(channel: str, models: Sequence[_Model]) -> Noise:
    """The noise around the trends, with its 90 % interval."""
    tau, fits = _best_tau(models)
    floor = _floor(models)
    low, high = (max(end, floor) for end in _interval(models, tau))
    count = sum(len(model.group.times) for model in models)
    return Noise(channel, max(_sigma(fits), floor), tau, (low, high), f"from {count} repeats")


def _floor(models: Sequence[_Model]) -> float:
    """Noise of rounding."""
    return max(model.quantum for model in models) / math.sqrt(12.0)


def noise_of_sums(noise: Noise, times: Array, weights: Array) -> Array:
    """Covariance (m, m) of weighted sums of measurement noise, in the channel's unit squared.

    Noise at two times has the correlation exp(-|t - t'| / tau), so the samples before one count by
    a recursion: the (n, n) covariance of the samples is never made.

    Args:
        noise: of the channel.
        times: [s] (n,) of the samples, increasing.
        weights: (m, n) of the samples in each sum.
    """
    before = np.zeros_like(weights)  # sum over the samples before, each with its correlation
    if noise.autocorrelation_time > 0.0:
        decay = np.exp(-np.diff(times) / noise.autocorrelation_time)
        for i, kept in enumerate(decay):
            before[:, i + 1] = kept * (before[:, i] + weights[:, i])
    one_way = weights @ before.T
    return np.asarray(noise.sigma**2 * (weights @ weights.T + one_way + one_way.T))


def _groups(recordings: Sequence[Recording], channel: str) -> list[tuple[Group, float]]:
    """The repeats of each recording on a common start, and the coarsest step between values."""
    made = []
    for recording in recordings:
        having = [its for its in recording.repeats if channel in its.series]
        pairs = [(its, its.series[channel]) for its in having]
        pairs = [(its, s) for its, s in pairs if np.sum(_telling(s)) >= FEWEST]
        if not pairs:
            continue
        first, free = pairs[0][1], [math.isinf(its.start_sd_s) for its, _ in pairs]
        shifts = [
            best_shift(first, s, free=free[0] or one)
            for (_, s), one in zip(pairs[1:], free[1:], strict=True)
        ]
        times = [s.times[_telling(s)] for _, s in pairs]
        times = [t - shift for t, shift in zip(times, [0.0, *shifts], strict=True)]
        values = [s.values[_telling(s)] for _, s in pairs]
        made.append((Group(times, values), max(s.quantum for _, s in pairs)))
    return made


def _telling(series: Series) -> BoolArray:
    """Samples that tell of noise: neither clipped nor at rest at an extreme."""
    values = series.values
    keep = ~series.clipped
    for extreme in (np.max(values), np.min(values)):
        at = np.concatenate([[False], values == extreme, [False]])
        edges = np.flatnonzero(np.diff(at.astype(np.int8)))
        for begin, end in edges.reshape(-1, 2):
            if end - begin >= REST:
                keep[begin:end] = False
    return keep


def _model(group: Group, quantum: float) -> _Model:
    """The group with the numbers of spline functions that Schwarz's criterion prefers.

    Repeats tell noise from trend by themselves. Their shared trend may bend at every second sample,
    so that a kink is no noise.
    """
    if len(group.times) < 2:
        options = [Basis(k, OWN[0]) for k in _sizes(group.samples)]
    else:
        most = group.samples // len(group.times) // 2
        options = [Basis(min(max(most, 4), MOST_FUNCTIONS), own) for own in OWN]
    return _Model(group, _preferred(group, quantum, options), quantum)


def _sizes(samples: int) -> list[int]:
    """Numbers of functions of the trend to try, each about 1.4 times the last."""
    most = min(max(samples // SAMPLES_PER_FUNCTION, 4), MOST_FUNCTIONS)
    sizes = np.unique(np.rint(5.0 * 1.4 ** np.arange(13)).astype(int))
    return [4, *(int(size) for size in sizes if size <= most)]


def _preferred(group: Group, quantum: float, options: Sequence[Basis]) -> Basis:
    def criterion(basis: Basis) -> float:
        _, (best,) = _best_tau([_Model(group, basis, quantum)])
        return information(best, group.samples)

    usable = [b for b in options if _functions(group, b) <= 0.7 * group.samples]
    return min(usable or options[:1], key=criterion)


def _functions(group: Group, basis: Basis) -> int:
    return basis.shared + (len(group.times) - 1) * basis.own


def _best_tau(models: Sequence[_Model]) -> tuple[float, list[Fit]]:
    """The autocorrelation time [s] of the largest restricted likelihood, and the trends there."""
    solve = _at(models)
    low, high = _range_of_tau(models)
    tau = math.exp(_least(lambda x: restricted(solve(math.exp(x))), math.log(low), math.log(high)))
    # Noise that decays within a quarter of a step is independent.
    tau = tau if tau > 1.25 * low else 0.0
    return tau, solve(tau)


def _at(models: Sequence[_Model]) -> Callable[[float], list[Fit]]:
    """The trends at an autocorrelation time [s]."""
    matrices = [design(model.group, model.basis) for model in models]
    return lambda tau: [fit(m.group, a, tau) for m, a in zip(models, matrices, strict=True)]


def _range_of_tau(models: Sequence[_Model]) -> tuple[float, float]:
    """From independent samples to the distance of knots [s]."""
    step = min(float(np.median(np.diff(t))) for model in models for t in model.group.times)
    return SHORTEST * step, max(min(model.slowest for model in models), step)


def _least(loss: Callable[[float], float], low: float, high: float) -> float:
    """Where a function of one number is least: the best of a few, then refined."""
    tried = np.linspace(low, high, 7)
    best = int(np.argmin([loss(float(x)) for x in tried]))
    bounds = (float(tried[max(best - 1, 0)]), float(tried[min(best + 1, tried.size - 1)]))
    return float(minimize_scalar(loss, bounds=bounds, method="bounded", options={"xatol": 0.02}).x)


def _sigma(fits: Sequence[Fit]) -> float:
    return math.sqrt(sum(f.squares for f in fits) / sum(f.freedom for f in fits))


def _interval(models: Sequence[_Model], best: float) -> tuple[float, float]:
    """Ends of the 90 % interval of sigma, over all autocorrelation times that the data allow.

    These are the times whose restricted likelihood is within 2.71 / 2 of the largest in logarithm.
    """
    solve = _at(models)
    low, high = _range_of_tau(models)
    near = max(low, best / NEAR), min(high, max(best, low) * NEAR)
    # At uneven times even the shortest of these correlates the closest samples.
    independent = [] if best > 0.0 else [0.0]
    fits = [solve(tau) for tau in (*independent, *np.geomspace(*near, TAUS))]
    losses = np.array([restricted(its) for its in fits])
    sigmas = np.array([_sigma(its) for its in fits])[losses < np.min(losses) + chi2.ppf(0.9, 1)]
    freedom = sum(its.freedom for its in fits[0])
    narrow, wide = (math.sqrt(freedom / float(chi2.ppf(q, freedom))) for q in INTERVAL)
    return narrow * float(np.min(sigmas)), wide * float(np.max(sigmas))


def _bounds(models: Sequence[_Model]) -> tuple[float, float]:
    """Least and most noise of single series [channel's unit].

    Least: what changes from sample to sample. Most: all that is left around a trend with a quarter
    of the functions, part of which may be the true course.
    """
    least, most = [], []
    for model in models:
        (times,), (values,) = model.group.times, model.group.values
        flags = np.zeros(times.size, dtype=np.bool_)
        least.append(roughness(Series("", times, values, 0.0, flags)))
        coarse = Basis(max(4, model.basis.shared // 4), OWN[0])
        its = fit(model.group, design(model.group, coarse), 0.0)
        most.append(math.sqrt(its.squares / its.freedom))
    return min(least), max(most)
