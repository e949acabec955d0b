"""Our own searches, run through their ask and tell.

To add one: write a function that builds it from a `Case` and a line in `OURS`. Levels are
called "0", "1", ... with the last the target; designs are in the case's box.
"""

import time
from collections.abc import Callable, Mapping
from functools import partial

import numpy as np

from benchmarks.search.case import Array, Case, Meter, Spent, Trace
from benchmarks.search.peers.ablations import ABLATIONS
from mfopt.records.problem import Problem, Variable
from mfopt.search.assisted import AssistedCmaEs
from mfopt.search.cmaes import CmaEs
from mfopt.search.search import Reevaluate, Rung, Search, Stage, default_population_size
from surrogates.autoregressive import AutoregressiveGp

Build = Callable[[Case, float, int], Search]


def problem_of(case: Case) -> Problem:
    """The case as a problem, with its start as the baseline."""
    bounds = zip(case.lower, case.upper, strict=True)
    variables = (Variable(f"x{i}", float(a), float(b)) for i, (a, b) in enumerate(bounds))
    return Problem(tuple(variables), case.x0)


def level_names(case: Case) -> tuple[str, ...]:
    """Names of the case's levels, cheap to target."""
    return tuple(str(i) for i in range(len(case.levels)))


def run_search(build: Build, case: Case, budget: float, seed: int) -> Trace:
    """Run a search until it stops or the budget is spent."""
    search = build(case, budget, seed)
    meter = Meter(case, budget, seed, follow_best=False)
    try:
        while (why := search.should_stop()) is None:
            began = time.process_time()
            candidates = search.ask()
            asked_s = time.process_time() - began
            values = [meter(_z(case, c.x), int(c.level)) for c in candidates]
            began = time.process_time()
            search.tell(candidates, values)
            if (x := search.recommended()) is not None:
                meter.recommend(_z(case, x), int(candidates[-1].level))
            meter.slowest_s = max(meter.slowest_s, asked_s + time.process_time() - began)
    except Spent as spent:
        why = str(spent)
    return meter.trace(why)


def planned_cmaes(case: Case, budget: float, seed: int, reevaluate: Reevaluate = "none") -> CmaEs:
    """`mfopt.CmaEs`, its generations planned by the same shares of the budget on each level."""
    size = default_population_size(case.dimension)
    share = budget / len(case.levels)
    stages = [
        Stage(name, max(1, int(share / cost / size)), size, case.sigma0, reevaluate=reevaluate)
        for name, cost in zip(level_names(case), case.costs, strict=True)
    ]
    return CmaEs(problem_of(case), stages, seed=seed)


def ranks(case: Case, budget: float, seed: int) -> CmaEs:
    """The same with the uncertainty handling of Hansen et al. 2009."""
    return planned_cmaes(case, budget, seed, "ranks")


def elite(case: Case, budget: float, seed: int) -> CmaEs:
    """The same with replicates where membership in the elite is in doubt and they pay."""
    return planned_cmaes(case, budget, seed, "elite")


def _z(case: Case, x: Array) -> Array:
    return np.asarray((x - case.lower) / (case.upper - case.lower))


def assisted(
    case: Case,
    budget: float,
    seed: int,
    search: type[AssistedCmaEs] = AssistedCmaEs,
    levels: slice = slice(None),
) -> AssistedCmaEs:
    """`mfopt.AssistedCmaEs` with the case's levels, or with some of them."""
    rungs = [Rung(name, cost) for name, cost in zip(level_names(case), case.costs, strict=True)]
    return search(
        problem_of(case), rungs[levels], AutoregressiveGp(), budget=budget, seed=seed,
        sigma=case.sigma0,
    )  # fmt: skip


BUILDS: Mapping[str, Build] = {
    "mfopt": assisted,
    "mfopt-target": partial(assisted, levels=slice(-1, None)),
    **{name: partial(assisted, search=kind) for name, kind in ABLATIONS.items()},
    "mfopt-cmaes": planned_cmaes,
    "mfopt-cmaes-ranks": ranks,
    "mfopt-cmaes-elite": elite,
}

OURS: Mapping[str, Callable[[Case, float, int], Trace]] = {
    name: partial(run_search, build) for name, build in BUILDS.items()
}
