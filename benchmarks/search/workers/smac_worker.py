"""SMAC3's multi-fidelity facade: random forest, expected improvement, Hyperband over the levels.

Source: Lindauer et al., JMLR 23 (2022) 54.
"""

import tempfile
from pathlib import Path

import numpy as np
from ConfigSpace import Configuration, ConfigurationSpace, Float
from smac import MultiFidelityFacade, Scenario
from smac.intensifier.hyperband import Hyperband
from smac.runhistory.dataclasses import TrialValue

from benchmarks.search.case import Array, Meter
from benchmarks.search.workers.fidelity import eta, level_of


def method(meter: Meter, seed: int) -> None:
    """Ask and tell until the budget is spent."""
    case = meter.case
    space = ConfigurationSpace(seed=seed)
    start = {f"z{i:02d}": float(z) for i, z in enumerate(case.z0)}
    space.add([Float(name, (0.0, 1.0), default=z) for name, z in start.items()])
    with tempfile.TemporaryDirectory() as scratch:
        scenario = Scenario(
            space, n_trials=1_000_000, seed=seed, deterministic=not case.noisy,
            min_budget=case.costs[0], max_budget=case.costs[-1], output_directory=Path(scratch),
        )  # fmt: skip
        smac = MultiFidelityFacade(
            scenario, lambda config, seed, budget: 0.0, logging_level=40, overwrite=True,
            intensifier=Hyperband(scenario, eta=eta(case), incumbent_selection="highest_budget"),
        )  # fmt: skip
        while True:
            trial = smac.ask()
            level = level_of(case, trial.budget)
            value = meter(_z(trial.config), level)
            smac.tell(trial, TrialValue(cost=value, time=0.0))
            if case.noisy and (incumbent := smac.intensifier.get_incumbent()) is not None:
                meter.recommend(_z(incumbent), level)


def _z(config: Configuration) -> Array:
    return np.array([config[name] for name in sorted(config)])
