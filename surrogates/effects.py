"""Emulator of scores that several effects change: any of them, alone or together.

The scores are sums of Gaussian processes of the base parameters z: one of the simulation without
effects, and one of what each effect e of strength s adds:

    t(z, s) = mean + f(z) + sum_e g_e(z, s_e) + noise,    g_e(z, 0) = 0

g_e is pinned to zero at zero strength: its kernel is that of a process of the strength, given that
it vanishes there. All runs, with an effect and without, teach f. Effects together add up.

Source: Duvenaud, Nickisch & Rasmussen 2011, Additive Gaussian Processes, NIPS 24.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg.lapack import dpotri
from scipy.optimize import minimize

from mfopt.arrays import Array, frozen
from surrogates.scores import LEAST_NOISE, NARROWEST, WIDEST, ScoreProcesses, correlation

NONE = -1  # the effect of a run that has none
BEND = 1.0  # length scale of a strength, over its range: smooth, and no straight line
SLOWER = 3.0  # times as slowly as the simulation itself do effects change with z
LEAST, MOST = 1e-6, 1e4  # variances, over that of a score
ROOT5 = math.sqrt(5.0)


@dataclass(frozen=True, slots=True, eq=False)
class Runs:
    """Where runs were made."""

    z: Array  # (n, d) base parameters in the unit cube
    effect: Array  # (n,) number of the effect, or NONE
    strength: Array  # (n,) over the range of the effect, from -1 to 1; 0 where it is absent

    def with_effect(self, effect: int) -> Array:
        """Whether the runs (n,) have that effect."""
        return np.asarray(self.effect == effect)


@dataclass(frozen=True, slots=True, eq=False)
class EffectProcesses(ScoreProcesses):
    """k independent sums of processes; points are base parameters, then strengths of `effects`."""

    runs: Runs
    sizes: Array  # (k, m) variance of each effect at full strength
    effects: tuple[int, ...] = ()  # numbers of those that are there

    def having(self, effects: Sequence[int]) -> "EffectProcesses":
        """The same processes, with these effects."""
        return replace(self, effects=tuple(effects))

    def _near(self, z: Array) -> Array:
        base = z[:, : self.z.shape[1]]
        total = self.signal[:, None, None] * correlation(base, self.z, self.lengths)
        for effect, s in self._strengths(z):
            its = np.flatnonzero(self.runs.with_effect(effect))
            slow = correlation(base, self.z[its], SLOWER * self.lengths)
            between = pinned(s, self.runs.strength[its])
            total[:, :, its] += self.sizes[:, effect, None, None] * between * slow
        return np.asarray(total)

    def _between(self, z: Array) -> Array:
        base = z[:, : self.z.shape[1]]
        return self._covariance(base, base, [(e, pinned(s, s)) for e, s in self._strengths(z)])

    def _variance(self, z: Array) -> Array:
        variance = np.tile(self.signal, (len(z), 1))
        for effect, s in self._strengths(z):
            variance = variance + np.diag(pinned(s, s))[:, None] * self.sizes[:, effect]
        return variance

    def _strengths(self, z: Array) -> list[tuple[int, Array]]:
        """The effects that are there, and the strengths (m,) of each at points (m, d + ...)."""
        return list(zip(self.effects, z[:, self.z.shape[1] :].T, strict=True))

    def _covariance(self, a: Array, b: Array, added: Sequence[tuple[int, Array]]) -> Array:
        """Covariance (k, m, n) of points (m, d) and (n, d), whose effects have these (m, n)."""
        total = self.signal[:, None, None] * correlation(a, b, self.lengths)
        if added:
            slow = correlation(a, b, SLOWER * self.lengths)
            for effect, between in added:
                total += self.sizes[:, effect, None, None] * between * slow
        return np.asarray(total)


def fit_effects(runs: Runs, scores: Array) -> EffectProcesses:
    """Fit each score (n, k) by maximum likelihood."""
    effects = 1 + int(runs.effect.max(initial=NONE))
    means = scores.mean(axis=0)
    fitted = [_fit(runs, s - m, effects) for s, m in zip(scores.T, means, strict=True)]
    signal, noise = (np.array([f[i] for f in fitted]) for i in (0, 3))
    lengths, sizes = (np.array([f[i] for f in fitted]) for i in (1, 2))
    n, k = scores.shape
    unknown = EffectProcesses(
        runs.z, means, signal, lengths, noise, np.empty((k, n, n)), np.empty((k, n)), runs, sizes
    )
    both = [
        (e, pinned(runs.strength, runs.strength) * np.outer(has, has))
        for e in range(effects)
        if (has := runs.with_effect(e)).any()
    ]
    covariance = unknown._covariance(runs.z, runs.z, both) + noise[:, None, None] * np.eye(n)
    inverse = np.linalg.inv(covariance)
    weights = np.einsum("knm,mk->kn", inverse, scores - means)
    return replace(unknown, inverse=frozen(inverse), weights=frozen(weights))


def _fit(runs: Runs, scores: Array, effects: int) -> tuple[float, Array, Array, float]:
    """Signal variance, lengths (d,), sizes (effects,) and noise variance of one score (n,)."""
    d = runs.z.shape[1]
    variance = float(scores.var()) or 1.0
    start = np.log([1.0, 0.1, *[1.0] * d, *[0.3] * effects])
    low = np.log([LEAST, LEAST_NOISE, *[NARROWEST] * d, *[LEAST] * effects])
    high = np.log([MOST, 2.0, *[WIDEST] * d, *[MOST] * effects])
    loss = _loss(runs, scores / np.sqrt(variance), effects)
    found = np.exp(minimize(loss, start, jac=True, bounds=list(zip(low, high, strict=True))).x)
    signal, noise = variance * found[:2]
    return float(signal), found[2 : 2 + d], variance * found[2 + d :], float(noise)


def _loss(runs: Runs, scores: Array, effects: int) -> Callable[[Array], tuple[float, Array]]:
    """Minus the log likelihood of standardised scores (n,), with its gradient.

    Of the logarithms of signal, noise, lengths (d,) and sizes (effects,).
    """
    n, d = runs.z.shape
    of_strength = pinned(runs.strength, runs.strength)
    masks = [np.flatnonzero(runs.with_effect(e)) for e in range(effects)]
    apart = (runs.z.T[:, :, None] - runs.z.T[:, None, :]) ** 2  # (d, n, n)
    between = [of_strength[np.ix_(its, its)] for its in masks]

    def loss(logs: Array) -> tuple[float, Array]:
        signal, noise = np.exp(logs[:2])
        lengths, sizes = np.exp(logs[2 : 2 + d]), np.exp(logs[2 + d :])
        far = ROOT5 * np.sqrt(np.tensordot(lengths**-2.0, apart, axes=1))
        base, slope = _matern(far)
        slow, slow_slope = _matern(far / SLOWER)
        added = np.zeros((n, n))
        for size, its, own in zip(sizes, masks, between, strict=True):
            added[np.ix_(its, its)] = size * own
        factor = np.linalg.cholesky(signal * base + added * slow + noise * np.eye(n))
        lower, _ = dpotri(factor, lower=1)
        inverse = lower + np.tril(lower, -1).T
        weights = inverse @ scores
        value = 0.5 * float(scores @ weights) + float(np.log(np.diag(factor)).sum())
        turn = 0.5 * (inverse - np.outer(weights, weights))  # d value / d covariance
        way = turn * (signal * slope + added * slow_slope / SLOWER**2)
        grown = turn * added * slow
        return value, np.array([
            signal * np.vdot(turn, base), noise * np.trace(turn),
            *(np.vdot(way, own) / length**2 for own, length in zip(apart, lengths, strict=True)),
            *(np.sum(grown[np.ix_(its, its)]) for its in masks),
        ])  # fmt: skip

    return loss


def _matern(far: Array) -> tuple[Array, Array]:
    """Correlation (n, n), and its derivative by minus half of the squared distance.

    Args:
        far: distances (n, n) in lengths, times the root of 5.
    """
    fall = np.exp(-far)
    return (1.0 + far + far**2 / 3.0) * fall, 5.0 / 3.0 * (1.0 + far) * fall


def pinned(s: Array, t: Array) -> Array:
    """Covariance (m, n) of a process of strengths (m,) and (n,) that is 0 at 0; 1 at 1."""
    one = np.ones((1, 1)) * BEND
    between, left, right, full = (
        correlation(a[:, None], b[:, None], one)[0]
        for a, b in ((s, t), (s, np.zeros(1)), (np.zeros(1), t), (np.ones(1), np.zeros(1)))
    )
    return np.asarray((between - left @ right) / (1.0 - full**2))
