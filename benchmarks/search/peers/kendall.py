"""Switching of levels by Kendall's tau, after Akimoto, Shimizu & Yamaguchi, GECCO 2019.

CMA-ES ranks a generation on the current level. When that level has cost `BETA` times what was
spent on looking at the next one, the generation is evaluated there too, and the rank
correlation enters a running mean; below `THRESHOLD` the search moves up. Looking down is
alike, with a margin. The strategy is never restarted: only its objective changes.

Source: doi:10.1145/3321707.3321709, with the authors' published settings.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import kendalltau

from benchmarks.search.case import Case, Meter, Trace, spend
from benchmarks.search.peers.evolution import Runs, mean_of

BETA = 1.0
THRESHOLD = 0.5
MARGIN = 0.2  # by which tau must exceed the threshold before the search moves down
RATE_UP = 0.5  # of the running mean of tau to the next level
RATE_DOWN = 0.1


@dataclass
class _Switch:
    """The level in use, what was spent since it came into use, and the two running means."""

    level: int = 0
    here: float = 0.0
    above: float = 0.0
    below: float = 0.0
    tau_above: float = 1.0
    tau_below: float = 0.0

    def move(self, step: int) -> None:
        self.level += step
        self.here = self.above = self.below = 0.0
        self.tau_above, self.tau_below = 1.0, 0.0


def kendall_tau(case: Case, budget: float, seed: int) -> Trace:
    """CMA-ES whose level follows Kendall's tau."""

    def run(meter: Meter) -> None:
        runs = Runs(meter, seed)
        switch = _Switch()
        while True:
            es = runs.new()
            while not es.stop():
                z = es.ask()
                values = [meter(row, switch.level) for row in z]
                switch.here += len(z) * case.costs[switch.level]
                es.tell(z, values)
                if case.noisy:
                    meter.recommend(mean_of(es), switch.level)
                _look(switch, meter, z, values)

    return spend(case, budget, seed, run)


def _look(switch: _Switch, meter: Meter, z: list[Any], values: list[float]) -> None:
    """Compare the generation with its neighbour levels where it is due, and move."""
    costs, level = meter.case.costs, switch.level
    if level < meter.case.target:  # the first look is expected to cost one generation
        switch.above = switch.above or len(z) * costs[level + 1]
        if BETA * switch.above < switch.here:
            tau = _tau(meter, z, values, level + 1)
            switch.above += len(z) * costs[level + 1]
            switch.tau_above += RATE_UP * (tau - switch.tau_above)
            if switch.tau_above < THRESHOLD:
                switch.move(1)
            return
    if level > 0:
        switch.below = switch.below or len(z) * costs[level - 1]
        if BETA * switch.below < switch.here:
            tau = _tau(meter, z, values, level - 1)
            switch.below += len(z) * costs[level - 1]
            switch.tau_below += RATE_DOWN * (tau - switch.tau_below)
            if switch.tau_below > THRESHOLD + MARGIN:
                switch.move(-1)


def _tau(meter: Meter, z: list[Any], values: list[float], level: int) -> float:
    other = [meter(row, level, audit=True) for row in z]
    tau = float(kendalltau(values, other).statistic)
    return 0.0 if np.isnan(tau) else tau
