"""The search of a study, or of a call of `minimize`; what it needs is only then loaded."""

from collections.abc import Sequence

from mfopt.arrays import Array
from mfopt.records.level import Ladder
from mfopt.records.problem import Problem
from mfopt.search.search import Search, Stage, rungs
from mfopt.search.swap import Pair


def make_search(
    problem: Problem,
    ladder: Ladder,
    *,
    stages: Sequence[Stage],
    budgets: Sequence[float],
    seed: int,
    sigma: float,
    population_size: int | None,
    seeds: int,
    objective: str = "returned",
    exchange: Pair | None = None,
    start: Array | None = None,
) -> Search:
    """CMA-ES on the stages of a plan; without a plan the search with a surrogate.

    Args:
        stages: the plan; the other settings that it holds are then not used.
        budgets: that the run was given, one after the other.
        start: first design (d,); the baseline if left out.

    Raises:
        ConfigError: if a setting is wrong.
    """
    if stages:
        from mfopt.search.cmaes import CmaEs

        return CmaEs(problem, stages, seed=seed, exchange=exchange, start=start)
    from mfopt.search.assisted import AssistedCmaEs
    from surrogates.autoregressive import AutoregressiveGp

    return AssistedCmaEs(
        problem,
        rungs(ladder, problem.baseline),
        AutoregressiveGp(),
        budget=budgets,
        seed=seed,
        sigma=sigma,
        population_size=population_size,
        objective=objective,
        seeds=seeds,
        exchange=exchange,
        start=start,
    )
