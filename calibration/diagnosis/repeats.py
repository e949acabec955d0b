"""Scatter between repeats that neither packing nor measurement noise explains.

Repeats of a real experiment differ: a hand lets go, a grain sticks. What they differ by is slow. In
each channel its amplitude is found from all recordings with repeats together, as slow waves over
time, the k-th 1 / (1 + k) as large:

    variance of a repeat's wave k = packing + measurement + (A / (1 + k))^2
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from calibration.likelihood import WAVES, Group, Likelihood
from calibration.observed import Observed
from mfopt.arrays import Array, frozen

FALLING = 1.0 / (1.0 + np.arange(WAVES))


def with_repeat_scatter(
    its: Likelihood, observations: Sequence[Observed]
) -> tuple[Likelihood, tuple[Array, ...]]:
    """The likelihood in which repeats scatter as they do.

    Returns:
        The likelihood, and for each recording the standard deviation (p,) of the mean of its
        repeats, from packing, measurement and what else they scatter by.
    """
    sizes = scatter_of_repeats(its, observations)
    groups, deviations = [], []
    for group, seen in zip(its.groups, observations, strict=True):
        factor = _factor(seen, sizes)
        in_scores = group.basis @ (factor / group.emulator.scale).T
        groups.append(replace(group, fixed=frozen(group.fixed + in_scores @ in_scores.T)))
        variance = np.diag(_of_one_repeat(group, seen)) / seen.repeats + np.sum(factor**2, axis=0)
        deviations.append(frozen(np.sqrt(variance)))
    return replace(its, groups=tuple(groups)), tuple(deviations)


def scatter_of_repeats(its: Likelihood, observations: Sequence[Observed]) -> dict[str, float]:
    """Amplitude A of each channel, in its unit; 0 where repeats differ no more than explained."""
    over: dict[str, list[tuple[float, int]]] = {}
    for group, seen in zip(its.groups, observations, strict=True):
        if seen.each is None or len(seen.each) < 2:
            continue
        apart = seen.each - seen.each.mean(axis=0)
        explained = _of_one_repeat(group, seen)
        for channel, rows in _waves(seen).items():
            found = np.sum((apart @ rows.T) ** 2, axis=0) / (len(apart) - 1)
            excess = found - np.einsum("kp,pq,kq->k", rows, explained, rows)
            points = float(np.count_nonzero(rows[0]))
            amplitude = float(np.sum(excess) / np.sum(FALLING[: len(rows)] ** 2)) / points
            over.setdefault(channel, []).append((amplitude, len(apart) - 1))
    return {channel: _mean(parts) for channel, parts in over.items()}


def _mean(parts: Sequence[tuple[float, int]]) -> float:
    """Root of the mean of squares that have so many degrees of freedom; 0 if that is negative."""
    squares, freedom = np.array(parts).T
    return float(np.sqrt(max(0.0, float(np.average(squares, weights=freedom)))))


def _of_one_repeat(group: Group, seen: Observed) -> Array:
    """Covariance (p, p) of one repeat by packing and measurement."""
    emulator = group.emulator
    spread = emulator.components * emulator.scale
    beyond = emulator.beyond * emulator.scale
    packing = spread.T @ emulator.noise @ spread + beyond.T @ beyond / len(beyond)
    return np.asarray(packing + seen.repeats * seen.measured)


def _factor(seen: Observed, sizes: Mapping[str, float]) -> Array:
    """Waves (k, p) whose squares are the variance of the mean of repeats that scatter so much."""
    factors = []
    for channel, rows in _waves(seen).items():
        points = float(np.count_nonzero(rows[0]))
        size = sizes.get(channel, 0.0) * np.sqrt(points / seen.repeats)
        factors.append(size * FALLING[: len(rows), None] * rows)
    return np.vstack(factors)


def _waves(seen: Observed) -> dict[str, Array]:
    """Slow waves (k, p) over the time of each channel, orthonormal."""
    found, at = {}, 0
    for block in seen.blocks:
        phase = np.zeros(1) if block.times is None else block.times / seen.end
        count = min(WAVES, block.size)
        waves, _ = np.linalg.qr(np.cos(np.pi * phase[:, None] * np.arange(count)))
        rows = np.zeros((count, len(seen.values)))
        rows[:, at : at + block.size] = waves.T
        found[block.channel] = rows
        at += block.size
    return found
