"""The sampling distribution of CMA-ES in the unit cube, as the assisted search uses it.

pycma holds mean, step size and covariance. The search sees samples, and coordinates u in which
the distribution is a standard normal: there a surrogate finds a function that is easy to learn.

Source: Hansen, arXiv:1604.00772; Bajer, Pitra, Repicky & Holena, Evolutionary Computation 27
(2019) 665, doi:10.1162/evco_a_00244 (surrogates in the whitened coordinates).
"""

from typing import Any

import numpy as np

from mfopt.arrays import Array
from mfopt.search.pycma import mean_of, strategy, tell

TRIES = 3  # to draw inside the cube


class Distribution:
    """A normal distribution over the unit cube that learns from ranked samples.

    Args:
        z: (d,) first mean.
        sigma: first step size.
        population_size: samples per generation.
        rng: of all draws.
    """

    def __init__(
        self, z: Array, sigma: float, population_size: int, rng: np.random.Generator
    ) -> None:
        self._es: Any = strategy(z, sigma, population_size, rng)
        self.average = self.mean  # (d,) of the means so far, see `update`

    @property
    def mean(self) -> Array:
        """Mean (d,), moved into the cube."""
        return mean_of(self._es)

    @property
    def sigma(self) -> float:
        """Step size."""
        return float(self._es.sigma)

    @property
    def widest(self) -> float:
        """Largest standard deviation of a variable."""
        return float(self.sigma * np.sqrt(np.max(self._es.sm.variances)))

    def sample(self, n: int) -> Array:
        """Draw (n, d) points of the cube.

        What falls outside is drawn anew a few times, then folded back. Folding alone would widen
        the distribution; drawing until a point is inside would keep it off an optimum at the walls.
        """
        return np.array([self._draw() for _ in range(n)])

    def _draw(self) -> Array:
        for _ in range(TRIES):
            (folded,) = self._es.ask(1)
            drawn = np.asarray(self._es.sent_solutions[folded]["geno"])
            if ((drawn >= 0.0) & (drawn <= 1.0)).all():
                break
        return np.asarray(folded)

    def to_u(self, z: Array) -> Array:
        """Whitened coordinates (n, d) of points (n, d) of the cube."""
        away = (np.atleast_2d(z) - self.mean) / self.sigma
        axes, lengths = self._axes
        return np.asarray(away @ axes / lengths @ axes.T)

    def to_z(self, u: Array) -> Array:
        """Points (n, d) of the cube from whitened coordinates (n, d), moved into it."""
        axes, lengths = self._axes
        away = np.atleast_2d(u) @ axes * lengths @ axes.T
        return np.asarray(np.clip(self.mean + self.sigma * away, 0.0, 1.0))

    @property
    def _axes(self) -> tuple[Array, Array]:
        """Principal axes (d, d), one a column, and the deviations (d,) on them, sigma apart."""
        return self._es.sm.B, self._es.sm.D

    def update(self, z: Array, losses: Array, share: float = 1.0) -> None:
        """Move the distribution towards the points (n, d) of low loss (n,).

        Points that were not drawn here are taken as injections, their length limited.

        Args:
            share: weight of the new mean in the average of the means.
        """
        tell(self._es, list(z), list(losses))
        self._es.pop_injection_directions = []  # mirrored samples are for generations drawn at once
        self._es.sm.update_now(-1)  # else the next sample would turn the coordinates
        self.average = self.average + share * (self.mean - self.average)

    def widen(self, widest: float) -> None:
        """Raise the step size until `widest` is at least this; the covariance is kept."""
        self._es.sigma *= max(1.0, widest / self.widest)
