"""DEHB: differential evolution with Hyperband over the levels.

Source: Awad, Mallik & Hutter, IJCAI 2021, arXiv:2105.09821.
"""

import tempfile

import numpy as np
from dehb import DEHB

from benchmarks.search.case import Meter
from benchmarks.search.workers.fidelity import eta, level_of


def method(meter: Meter, seed: int) -> None:
    """Ask and tell until the budget is spent."""
    case = meter.case
    with tempfile.TemporaryDirectory() as scratch:
        dehb = DEHB(
            f=lambda config, fidelity: {}, dimensions=case.dimension, cs=None,
            min_fidelity=case.costs[0], max_fidelity=case.costs[-1], eta=eta(case),
            n_workers=1, seed=seed, output_path=scratch, log_level="ERROR",
        )  # fmt: skip
        while True:
            job = dehb.ask()
            level = level_of(case, job["fidelity"])
            value = meter(np.asarray(job["config"]), level)
            dehb.tell(job, {"fitness": value, "cost": case.costs[level]})
            if case.noisy and dehb.inc_config is not None:
                meter.recommend(np.asarray(dehb.inc_config), level)
