"""Two samples of runs compared: how far apart they are, and whether that is chance.

A run is what is independent, not a grain: grains of one run flow together. So distributions of
grains are compared by exchanging whole runs between the samples.
"""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from mfopt.arrays import Array, IntArray

SPLITS = 20_000  # exchanges looked at; p-values are no finer than one over this
BATCH = 2_000  # of them at a time
GRID = 400  # quantiles at which distributions are compared
TIE = 1e-9  # statistics closer than this [relative] are equal: rounding must not decide
COVERAGE = 0.95
NORMAL = 1.96  # quantile of a normal distribution for that coverage

Statistic = Callable[[IntArray], Array]  # of splits (m, runs): first those of the reference


@dataclass(frozen=True, slots=True)
class Interval:
    """An estimate and its confidence interval."""

    estimate: float
    low: float
    high: float

    def inside(self, limit: float) -> bool:
        """Whether the whole interval lies within plus and minus `limit`."""
        return -limit <= self.low and self.high <= limit


def relative_difference(reference: Array, other: Array) -> Interval:
    """Difference of the means over the mean of `reference`, with its 95 % interval.

    Welch's interval of ln(mean of other / mean of reference): the variance of a mean's logarithm
    is s^2 / (n mean^2), the degrees of freedom are those of Welch and Satterthwaite
    (doi:10.1093/biomet/34.1-2.28). It holds for three runs too, where a bootstrap is too narrow.
    nan for a mean that is not positive, and for the interval of a single run.
    """
    from scipy.stats import t  # half a second, which only this needs

    means = float(reference.mean()), float(other.mean())
    if min(means) <= 0:
        return Interval(math.nan, math.nan, math.nan)
    ratio = means[1] / means[0]
    if min(len(reference), len(other)) < 2:
        return Interval(ratio - 1, math.nan, math.nan)
    parts = [
        float(sample.var(ddof=1)) / (len(sample) * mean**2)
        for sample, mean in zip((reference, other), means, strict=True)
    ]
    variance = sum(parts)
    if variance == 0.0:
        return Interval(ratio - 1, ratio - 1, ratio - 1)
    freedom = variance**2 / (
        parts[0] ** 2 / (len(reference) - 1) + parts[1] ** 2 / (len(other) - 1)
    )
    reach = float(t.ppf((1 + COVERAGE) / 2, freedom)) * math.sqrt(variance)
    return Interval(ratio - 1, ratio * math.exp(-reach) - 1, ratio * math.exp(reach) - 1)


def runs_needed(reference: Array, other: Array, limit: float) -> int | None:
    """Runs of each engine until the interval of equal means lies within `limit` either way.

        n = (1.96 / ln(1 + limit))^2 (v_reference + v_other),   v = (s / mean)^2

    None where a sample has one run, or a mean that is not positive.
    """
    samples = (reference, other)
    if any(len(sample) < 2 or float(sample.mean()) <= 0 for sample in samples):
        return None
    scatter = sum(float(sample.var(ddof=1)) / float(sample.mean()) ** 2 for sample in samples)
    return max(2, math.ceil((NORMAL / math.log1p(limit)) ** 2 * scatter))


def permutation_p(reference: Array, other: Array, *, seed: int = 0) -> float:
    """Chance of a Welch t at least as far from 0, were both samples from one distribution.

    The studentised statistic keeps its level where the samples scatter differently, too
    (Chung and Romano, doi:10.1214/13-AOS1090).
    """
    values = np.concatenate([reference, other])
    n = len(reference)

    def statistic(splits: IntArray) -> Array:
        return np.abs(_welch(values[splits[:, :n]], values[splits[:, n:]]))

    return _exchange(statistic, n, len(other), seed)


def _welch(a: Array, b: Array) -> Array:
    """Welch's t of samples in the rows of (m, n_a) and (m, n_b)."""
    gap = a.mean(axis=1) - b.mean(axis=1)
    if min(a.shape[1], b.shape[1]) < 2:
        return np.asarray(gap)
    variance = a.var(axis=1, ddof=1) / a.shape[1] + b.var(axis=1, ddof=1) / b.shape[1]
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.nan_to_num(gap / np.sqrt(variance), nan=0.0))


def distribution_p(
    reference: Sequence[Array], other: Sequence[Array], *, seed: int = 0
) -> tuple[float, float]:
    """Compare the pooled values of two samples of runs by exchanging whole runs.

    The statistic is the energy distance, in one dimension 2 int (F - G)^2 dx (Szekely and Rizzo,
    doi:10.1016/j.jspi.2013.03.018).

    Returns:
        Its p-value, and the largest distance of the two distribution functions (Kolmogorov).
    """
    runs = [np.sort(run) for run in (*reference, *other)]
    pooled = np.quantile(np.concatenate(runs), np.linspace(0.0, 1.0, GRID))
    below = np.array([np.searchsorted(run, pooled, side="right") for run in runs], float)
    sizes = np.array([len(run) for run in runs], float)
    steps, n = np.diff(pooled), len(reference)

    def gap(splits: IntArray) -> Array:
        one, two = splits[:, :n], splits[:, n:]
        f = below[one].sum(axis=1) / sizes[one].sum(axis=1)[:, None]
        g = below[two].sum(axis=1) / sizes[two].sum(axis=1)[:, None]
        return np.asarray(f - g)

    def statistic(splits: IntArray) -> Array:
        return np.asarray(2.0 * (gap(splits)[:, :-1] ** 2) @ steps)

    p = _exchange(statistic, n, len(other), seed)
    given = np.arange(len(runs))[None]
    return p, float(np.abs(gap(given)).max())


def smallest_p(n_reference: int, n_other: int) -> float:
    """The smallest p-value that an exchange of so many runs can give, however far apart they are.

    The split as it is always counts, and for samples of one size so does its mirror image.
    """
    splits = math.comb(n_reference + n_other, n_reference)
    if splits > SPLITS:
        return 1 / (1 + SPLITS)
    return (2 if n_reference == n_other else 1) / splits


def _exchange(statistic: Statistic, n_reference: int, n_other: int, seed: int) -> float:
    """Share of splits whose statistic is at least that of the split as it is."""
    total = n_reference + n_other
    given = float(statistic(np.arange(total)[None])[0])
    as_far = count = 0
    exact = math.comb(total, n_reference) <= SPLITS
    for splits in _all_splits(total, n_reference) if exact else _random_splits(total, seed):
        as_far += int((statistic(splits) >= given * (1 - TIE)).sum())
        count += len(splits)
    return as_far / count if exact else (1 + as_far) / (1 + count)


def _all_splits(total: int, n: int) -> Iterator[IntArray]:
    everything = np.arange(total)
    combinations = itertools.combinations(range(total), n)
    while chosen := list(itertools.islice(combinations, BATCH)):
        first = np.array(chosen)
        there = np.zeros((len(first), total), dtype=bool)
        np.put_along_axis(there, first, True, axis=1)
        rest = np.broadcast_to(everything, there.shape)[~there].reshape(len(first), total - n)
        yield np.hstack([first, rest])


def _random_splits(total: int, seed: int) -> Iterator[IntArray]:
    rng = np.random.default_rng(seed)
    for _ in range(SPLITS // BATCH):
        yield rng.permuted(np.tile(np.arange(total), (BATCH, 1)), axis=1)


def holm(p_values: Sequence[float]) -> list[float]:
    """Holm's adjusted p-values: reject those below the family-wise level.

    Holm (1979), https://www.jstor.org/stable/4615733.
    """
    order = np.argsort(p_values)
    adjusted, highest = [0.0] * len(p_values), 0.0
    for rank, i in enumerate(order):
        highest = max(highest, min(1.0, (len(p_values) - rank) * p_values[i]))
        adjusted[i] = highest
    return adjusted
