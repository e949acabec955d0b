"""pycma in the unit cube: how both searches make it, and how it is told losses."""

import importlib
import sys
import threading
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from mfopt.arrays import Array

WIDEST = 1.0 / 3.0  # largest standard deviation of a variable, pycma's own limit in a unit box

# pycma works without these two, which only its figures and its own surrogate models use. To load
# them takes a second, half of the start of a small run.
LEFT_OUT = ("scipy.stats", "matplotlib.pyplot")


class _LeftOut:
    """Tells the thread that made it that modules are not installed."""

    def __init__(self) -> None:
        self.thread = threading.get_ident()

    def find_spec(self, name: str, path: object, target: object = None) -> None:
        """Called by Python for each module that is not loaded yet."""
        if name in LEFT_OUT and threading.get_ident() == self.thread:
            raise ModuleNotFoundError(f"not needed: {name}", name=name)


def _pycma() -> Any:
    """Load pycma, which carries no types, without the modules that it can leave out."""
    finder = _LeftOut()
    sys.meta_path.insert(0, finder)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of pycma, that it cannot draw
            return importlib.import_module("cma")
    finally:
        sys.meta_path.remove(finder)


cma = _pycma()


def strategy(
    z: Array, sigma: float, population_size: int, rng: np.random.Generator, **options: Any
) -> Any:
    """A `cma.CMAEvolutionStrategy` in the unit cube, which carries no types.

    Args:
        z: (d,) first mean, moved into the cube.
        sigma: first step size.
        population_size: samples per generation.
        rng: of all draws.
        options: of pycma, besides.
    """
    options |= {
        "bounds": [0.0, 1.0], "popsize": population_size, "seed": np.nan,
        "randn": lambda *shape: rng.standard_normal(shape), "verbose": -9, "verb_log": 0,
    }  # fmt: skip
    if len(z) == 1:
        options["maxstd_boundrange"] = np.inf  # pycma fails where it limits a single variable
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        es = cma.CMAEvolutionStrategy(np.clip(z, 0.0, 1.0), sigma, options)
    _limit(es)
    return es


def mean_of(es: Any) -> Array:
    """Mean (d,) of the distribution, moved into the cube."""
    return np.asarray(es.gp.pheno(es.mean, into_bounds=es.boundary_handler.repair))


def tell(es: Any, z: Sequence[Array], losses: Sequence[float]) -> None:
    """Tell losses of points of the cube; pycma warns of flat and of injected ones."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        es.tell(list(z), list(losses))
    _limit(es)


def _limit(es: Any) -> None:
    """The limit of the standard deviation for one variable, by the step size."""
    if es.N == 1:
        es.sigma *= min(1.0, WIDEST / float(es.stds[0]))
