"""Our own searches, run through their ask and tell.

To add one: write a function that builds it from a `Case` and a line in `OURS`. Levels are
called "0", "1", ... with the last the target; designs are in the case's box.
"""

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Protocol

import numpy as np

from benchmarks.search.case import Array, Case, Meter, Spent, Trace
from mfopt.cmaes import CmaEs
from mfopt.evaluation import Candidate
from mfopt.problem import Problem, Variable
from mfopt.search import Stage


class AskTell(Protocol):
    """The part of `mfopt.search.Search` that is used; `recommended() -> x` where there is one."""

    def ask(self) -> list[Candidate]: ...

    def tell(self, candidates: list[Candidate], values: list[float]) -> None: ...

    def should_stop(self) -> str | None: ...


Build = Callable[[Case, float, int], AskTell]


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
    recommended: Callable[[], Array] | None = getattr(search, "recommended", None)
    meter = Meter(case, budget, seed, follow_best=recommended is None)
    try:
        while (why := search.should_stop()) is None:
            began = time.process_time()
            candidates = search.ask()
            asked_s = time.process_time() - began
            values = [meter(_z(case, c.x), int(c.level)) for c in candidates]
            began = time.process_time()
            search.tell(candidates, values)
            if recommended is not None:
                meter.recommend(_z(case, recommended()), int(candidates[-1].level))
            meter.slowest_s = max(meter.slowest_s, asked_s + time.process_time() - began)
    except Spent as spent:
        why = str(spent)
    return meter.trace(why)


def planned_cmaes(case: Case, budget: float, seed: int) -> CmaEs:
    """`mfopt.CmaEs`, its generations planned by the same shares of the budget on each level."""
    size = 4 + int(3 * np.log(case.dimension))
    share = budget / len(case.levels)
    stages = [
        Stage(name, max(1, int(share / cost / size)), size, case.sigma0)
        for name, cost in zip(level_names(case), case.costs, strict=True)
    ]
    return CmaEs(problem_of(case), stages, seed=seed)


def _z(case: Case, x: Array) -> Array:
    return np.asarray((x - case.lower) / (case.upper - case.lower))


BUILDS: Mapping[str, Build] = {
    "mfopt-cmaes": planned_cmaes,
}

OURS: Mapping[str, Callable[[Case, float, int], Trace]] = {
    name: partial(run_search, build) for name, build in BUILDS.items()
}
