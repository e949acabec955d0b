"""The package `cmaes`: learning-rate adaptation, and a warm start from the cheap level.

Sources: LRA-CMA-ES: Nomura, Akimoto & Ono, arXiv:2401.15876; WS-CMA-ES: Nomura et al.,
AAAI 2021, arXiv:2012.06932.
"""

from typing import Any

import numpy as np
from cmaes import CMA, get_warm_start_mgd

from benchmarks.search.case import Array, Case, Meter, Trace, spend
from benchmarks.search.peers.evolution import Runs, strategy

SOURCE_RUNS = 30  # evaluations per variable on the cheap level, by CMA-ES


def lra(case: Case, budget: float, seed: int) -> Trace:
    """CMA-ES with learning-rate adaptation, at the default population."""

    def run(meter: Meter) -> None:
        runs = Runs(meter, seed)
        restart = 0
        while True:
            z0 = case.z0 if restart == 0 else runs.rng.random(case.dimension)
            es = CMA(z0, case.sigma0, _bounds(case), seed=seed + 1000 * restart, lr_adapt=True)
            _to_the_end(es, meter)
            restart += 1

    return spend(case, budget, seed, run)


def warm_start(case: Case, budget: float, seed: int) -> Trace:
    """CMA-ES on the target, started with the distribution of the best tenth of cheap runs."""

    def run(meter: Meter) -> None:
        source = _cheap_runs(case, meter, seed)
        mean, sigma, covariance = get_warm_start_mgd(source, gamma=0.1, alpha=0.1)
        restart = 0
        while True:
            es = CMA(mean, sigma, _bounds(case), seed=seed + 1000 * restart, cov=covariance)
            _to_the_end(es, meter)
            mean, sigma, covariance = _anywhere(case, seed + restart)
            restart += 1

    return spend(case, budget, seed, run)


def _cheap_runs(case: Case, meter: Meter, seed: int) -> list[tuple[Array, float]]:
    """CMA-ES on the cheapest level; designs and their values."""
    es = strategy(case.z0, case.sigma0, np.random.default_rng(seed))
    source: list[tuple[Array, float]] = []
    while len(source) < SOURCE_RUNS * case.dimension:
        z = es.ask()
        values = [meter(row, 0) for row in z]
        es.tell(z, values)
        source += [(np.asarray(row), value) for row, value in zip(z, values, strict=True)]
        if case.noisy:
            meter.recommend(es.result.xfavorite, 0)
    return source


def _to_the_end(es: Any, meter: Meter) -> None:
    while not es.should_stop():
        told = []
        for _ in range(es.population_size):
            z = es.ask()
            told.append((z, meter(z)))
        es.tell(told)
        if meter.case.noisy:
            meter.recommend(np.clip(es.mean, 0.0, 1.0))


def _anywhere(case: Case, seed: int) -> tuple[Array, float, Array]:
    z = np.random.default_rng(seed).random(case.dimension)
    return z, case.sigma0, np.eye(case.dimension)


def _bounds(case: Case) -> Array:
    return np.tile([0.0, 1.0], (case.dimension, 1))
