"""The statistics of a report; they hold for few seeds, too."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mfopt.arrays import Array

CONFIDENCE = 0.95  # wanted coverage; five seeds reach 0.9375 at most


@dataclass(frozen=True, slots=True)
class Interval:
    """An interval and the probability that it holds the true median."""

    low: float
    high: float
    coverage: float


def coverage(n: int, k: int) -> float:
    """Probability that the median lies between the k-th smallest and k-th largest of n values.

    1 - 2 P(B < k) with B binomial(n, 1/2): exact for every continuous distribution.

    Source: David and Nagaraja, Order Statistics, 2003, section 7.1.
    """
    return 1.0 - 2.0 * sum(math.comb(n, i) for i in range(k)) / 2.0**n


def median_interval(values: Array, confidence: float = CONFIDENCE) -> Interval | None:
    """Order-statistic interval of the median, the narrowest that covers `confidence`.

    If there are too few values, the interval is the whole range, with a lower coverage. None for
    fewer than two values.
    """
    n = len(values)
    if n < 2:
        return None
    k = 1
    while 2 * (k + 1) <= n and coverage(n, k + 1) >= confidence:
        k += 1
    ordered = np.sort(values)
    return Interval(float(ordered[k - 1]), float(ordered[n - k]), coverage(n, k))


def median(values: ArrayLike) -> float:
    """Median that overflows for no values; nan without any."""
    ordered = np.sort(np.asarray(values, dtype=float))
    if not ordered.size:
        return math.nan
    low, high = float(ordered[(ordered.size - 1) // 2]), float(ordered[ordered.size // 2])
    return low if low == high else low / 2.0 + high / 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """One quantity of the best design against the baseline's, on the same seeds."""

    seeds: tuple[int, ...]
    best: Array  # (n,), infinite where the run failed
    baseline: Array  # (n,)

    @property
    def median_best(self) -> float:
        """Median over the seeds."""
        return median(self.best)

    @property
    def median_baseline(self) -> float:
        """Median over the seeds."""
        return median(self.baseline)

    @property
    def reduction(self) -> float | None:
        """Reduction of the median [%]; None unless both are positive and finite."""
        base, best = self.median_baseline, self.median_best
        if not (0.0 < base < math.inf and 0.0 <= best < math.inf):
            return None
        return 100.0 * (1.0 - best / base)

    @property
    def reduction_interval(self) -> Interval | None:
        """Interval of the reduction [%], from pairs of runs with the same seed."""
        whole = np.isfinite(self.best) & np.isfinite(self.baseline) & (self.baseline > 0.0)
        if self.reduction is None or not whole.all():
            return None
        return median_interval(100.0 * (1.0 - self.best / self.baseline))
