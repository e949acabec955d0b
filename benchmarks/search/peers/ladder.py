"""CMA-ES up a fixed ladder: restarted from the best design (noisy: from the mean) at each level.

The peer to beat. Three ways to say when to climb:

- `ladder-stall`: when the median of a generation has not improved for `PATIENCE` generations
  by more than `PROGRESS` of what was gained on this level;
- `ladder-shares`: when a level has used its share of the budget;
- `ladder-short`: the same, planned for half of the budget.

The step size of a later level is `LATER_SIGMA`; on the last level restarts double the population.
Settings are those that did best on the tuning instances (benchmarks/README.md).
"""

from collections.abc import Callable

import numpy as np

from benchmarks.search.case import Array, Case, Meter, Trace, spend
from benchmarks.search.peers.evolution import mean_of, strategy

PATIENCE = 5  # generations
PROGRESS = 0.02
LATER_SIGMA = 0.05  # of the unit cube
SHARES = (0.3, 0.4)  # of the budget, for the cheapest level and for the ones between


def ladder_stall(case: Case, budget: float, seed: int) -> Trace:
    """Climb where progress stalls."""

    def run(meter: Meter) -> None:
        climb_ladder(meter, seed, lambda level, spent, medians: stalled(medians))

    return spend(case, budget, seed, run)


def ladder_shares(case: Case, budget: float, seed: int) -> Trace:
    """Climb where the level's share of the budget is used."""
    between = max(1, len(case.levels) - 2)

    def used(level: int, spent: float, medians: list[float]) -> bool:
        share = SHARES[0] if level == 0 else SHARES[1] / between
        return spent >= share * budget

    return spend(case, budget, seed, lambda meter: climb_ladder(meter, seed, used))


def ladder_short(case: Case, budget: float, seed: int) -> Trace:
    """A plan for half of the budget: cheaper to a loose target, more often short of a tight one."""
    return ladder_shares(case, budget / 2.0, seed)


def stalled(medians: list[float], patience: int = PATIENCE, progress: float = PROGRESS) -> bool:
    """Whether the lowest median is old, or hardly below the one `patience` generations ago."""
    if len(medians) <= 2 * patience:
        return False
    before, now = min(medians[:-patience]), min(medians)
    return before - now <= progress * (medians[0] - before)


def climb_ladder(meter: Meter, seed: int, climb: Callable[[int, float, list[float]], bool]) -> None:
    """CMA-ES on one level after the other; `climb(level, spent, medians)` says when to go on."""
    case = meter.case
    rng = np.random.default_rng(seed)
    z, sigma = case.z0, case.sigma0
    for level in range(case.target):
        z = _one_level(meter, level, z, sigma, rng, climb)
        sigma = LATER_SIGMA
    population = 4 + int(3 * np.log(case.dimension))
    while True:
        z = _one_level(meter, case.target, z, sigma, rng, lambda *_: False, population)
        population *= 2


def _one_level(
    meter: Meter,
    level: int,
    start: Array,
    sigma: float,
    rng: np.random.Generator,
    climb: Callable[[int, float, list[float]], bool],
    population: int | None = None,
) -> Array:
    """Search one level; its best design, or under noise the last mean."""
    options = {} if population is None else {"popsize": population}
    es = strategy(start, sigma, rng, **options)
    best, best_value, begun = start, meter(start, level), meter.cost
    medians: list[float] = []
    while not es.stop() and not climb(level, meter.cost - begun, medians):
        z = es.ask()
        values = [meter(row, level) for row in z]
        es.tell(z, values)
        medians.append(float(np.median(values)))
        if meter.case.noisy:
            best = mean_of(es)
            meter.recommend(best, level)
        elif min(values) < best_value:
            best, best_value = np.asarray(z[int(np.argmin(values))]), min(values)
    return best
