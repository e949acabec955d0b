"""CMA-ES of pycma in the unit cube, as several peers use it."""

from typing import Any

import cma
import numpy as np

from benchmarks.search.case import Array, Meter


def strategy(z0: Array, sigma: float, rng: np.random.Generator, **options: Any) -> Any:
    """A `cma.CMAEvolutionStrategy` that draws from `rng` alone."""
    settings = {
        "bounds": [0.0, 1.0], "verbose": -9, "verb_log": 0, "seed": np.nan,
        "randn": lambda *shape: rng.standard_normal(shape),
    }  # fmt: skip
    return cma.CMAEvolutionStrategy(z0, sigma, settings | options)


def mean_of(es: Any) -> Array:
    """The mean of the distribution, inside the cube: what pycma calls its favourite."""
    return np.asarray(es.result.xfavorite)


class Runs:
    """Restarts with twice the population each (IPOP), and which run to recommend from.

    Under noise the run is recommended from whose last generation has the lowest median.
    Source: Auger & Hansen, CEC 2005.
    """

    def __init__(self, meter: Meter, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        self._meter = meter
        self._number = 0
        self._recommended = (0, np.inf)  # run, median of its last generation

    def new(self, **options: Any) -> Any:
        """The next run: the first from the given start, later ones from anywhere."""
        case = self._meter.case
        z0 = case.z0 if self._number == 0 else self.rng.random(case.dimension)
        size = (4 + int(3 * np.log(case.dimension))) * 2**self._number
        self._number += 1
        return strategy(z0, case.sigma0, self.rng, popsize=size, **options)

    def recommend_mean(self, z: Array, values: list[float]) -> None:
        """Under noise: recommend the mean of this run unless an earlier run was better."""
        if not self._meter.case.noisy:
            return
        median = float(np.median(values))
        if self._recommended[0] in (0, self._number) or median < self._recommended[1]:
            self._recommended = (self._number, median)
            self._meter.recommend(z)
