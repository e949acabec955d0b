"""The output transform: identity below a knot, logarithmic compression above it."""

from dataclasses import dataclass

import numpy as np

from mfopt.arrays import Array, IntArray

NODES, NODE_WEIGHTS = np.polynomial.hermite_e.hermegauss(20)
NODE_WEIGHTS = NODE_WEIGHTS / NODE_WEIGHTS.sum()
LARGEST_EXPONENT = 200.0  # beyond this the inverse would overflow when squared
SMALLEST_WARP = 1e-100  # scale below which its quotients would overflow


@dataclass(frozen=True, slots=True)
class Warp:
    """A strictly monotone map with a continuous derivative.

    T(f) = f for f <= m, and m + s log(1 + (f - m) / s) above. The better half of the values does
    not change, so a quadratic function stays quadratic near the minimum. Huge values lose weight.

    Args:
        knot: m, in units of the objective.
        scale: s > 0, in units of the objective; the larger, the weaker the compression.
    """

    knot: float
    scale: float

    def compressed(self, logarithm: float) -> "Warp":
        """The same transform with the scale multiplied by exp(`logarithm`)."""
        return Warp(self.knot, self.scale * float(np.exp(logarithm)))

    def forward(self, value: Array) -> Array:
        """T(f)."""
        above = np.maximum(value - self.knot, 0.0)
        return np.minimum(value, self.knot) + self.scale * np.log1p(above / self.scale)

    def slope(self, value: Array) -> Array:
        """dT/df, in (0, 1]."""
        return 1.0 / (1.0 + np.maximum(value - self.knot, 0.0) / self.scale)

    def inverse(self, transformed: Array) -> Array:
        """The f with T(f) = `transformed`; capped where it would overflow."""
        above = np.clip((transformed - self.knot) / self.scale, 0.0, LARGEST_EXPONENT)
        return np.minimum(transformed, self.knot) + self.scale * np.expm1(above)

    def moments(
        self, mean: Array, variance: Array, seen: float, lowest: float = -np.inf
    ) -> tuple[Array, Array]:
        """Mean and variance of f = T^-1(y) for y ~ N(mean, variance), limited from both sides.

        By Gauss-Hermite quadrature with 20 nodes.

        Args:
            seen: upper limit of f, or the inverse of `mean` if that is larger.
            lowest: lower limit of f.
        """
        y = mean[:, None] + np.sqrt(variance)[:, None] * NODES
        highest = np.maximum(self.inverse(mean), seen)[:, None]
        values = np.clip(self.inverse(y), lowest, highest)
        first = values @ NODE_WEIGHTS
        return first, (values - first[:, None]) ** 2 @ NODE_WEIGHTS


def warp_of_objective(value: Array, level: IntArray, fewest: int = 10) -> Warp:
    """The default transform of finite values (n,): knot at the median, scale median - minimum.

    Both are taken at the finest level with at least `fewest` values, else over all values.
    """
    for finest in sorted(set(level.tolist()), reverse=True):
        chosen = value[level == finest]
        if len(chosen) >= fewest:
            break
    else:
        chosen = value
    knot = float(np.median(chosen))
    below, above = knot - float(chosen.min()), float(chosen.max()) - knot
    return Warp(knot, max(below or above or abs(knot) or 1.0, SMALLEST_WARP))


def warp_of_count(count: Array) -> Warp:
    """The default transform of counts (n,): logarithmic from 0 on the scale of their median."""
    positive = count[count > 0.0]
    return Warp(0.0, max(float(np.median(positive)), SMALLEST_WARP) if len(positive) else 1.0)
