"""pycma on the target level: plain, with its linear-quadratic surrogate, with its noise handling.

Noise-free they recommend the best value measured, under noise the mean of the distribution.

Sources: Hansen, arXiv:1604.00772; lq-CMA-ES: Hansen, GECCO 2019, doi:10.1145/3321707.3321842;
noise handling: Hansen et al., IEEE Trans. Evol. Comp. 13 (2009), doi:10.1109/TEVC.2008.924423.
"""

from typing import Any

import cma
import numpy as np
from scipy.stats import kendalltau

from benchmarks.search.case import Case, Meter, Trace, spend
from benchmarks.search.peers.evolution import Runs, mean_of

cma.fitness_models._kendalltau = kendalltau  # `mfopt.search.pycma` loads pycma without SciPy's
MOST_REEVALUATIONS = 30  # as pycma's own example sets it


def pycma(case: Case, budget: float, seed: int) -> Trace:
    """CMA-ES with restarts."""

    def run(meter: Meter) -> None:
        runs = Runs(meter, seed)
        while True:
            es = runs.new()
            while not es.stop():
                z = es.ask()
                values = [meter(row) for row in z]
                es.tell(z, values)
                runs.recommend_mean(mean_of(es), values)

    return spend(case, budget, seed, run)


def lq(case: Case, budget: float, seed: int) -> Trace:
    """lq-CMA-ES: the loop of `cma.fmin_lq_surr2`, every true evaluation seen by the meter."""

    def run(meter: Meter) -> None:
        runs = Runs(meter, seed)
        while True:
            es = runs.new()
            surrogate: Any = cma.fitness_models.SurrogatePopulation(meter)
            while not es.stop():
                z = es.ask()
                values = surrogate(z)
                es.tell(z, values)
                es.inject([surrogate.model.xopt])
                runs.recommend_mean(mean_of(es), values)

    return spend(case, budget, seed, run)


def noise_handler(case: Case, budget: float, seed: int) -> Trace:
    """CMA-ES with pycma's NoiseHandler (uncertainty handling by re-evaluation)."""

    def run(meter: Meter) -> None:
        runs = Runs(meter, seed)
        np.random.seed(seed)  # noqa: NPY002 - the handler draws from numpy's global generator
        while True:
            es = runs.new()
            handler = cma.NoiseHandler(es.N, maxevals=[1, 1, MOST_REEVALUATIONS])
            while not es.stop():
                z, values = es.ask_and_eval(meter, evaluations=handler.evaluations)
                es.tell(z, values)
                es.sigma *= handler(z, values, meter, es.ask)
                runs.recommend_mean(mean_of(es), list(values))

    return spend(case, budget, seed, run)
