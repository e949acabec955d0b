"""`minimize`: the user's own simulators over a ladder of levels, in one call."""

import logging
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from fidelity.programs.function import FunctionLevel, Simulator
from mfopt.arrays import frozen
from mfopt.campaign.begin import begin, budgets
from mfopt.campaign.check import check_stored
from mfopt.campaign.driver import Progress, Run, run_of
from mfopt.campaign.executor import Runner, one_thread
from mfopt.campaign.header import header
from mfopt.campaign.local_workers import local_processes
from mfopt.campaign.run import run_study
from mfopt.campaign.store import writing
from mfopt.checks import shown, whole
from mfopt.errors import ConfigError
from mfopt.files.scratch import scratch
from mfopt.records.evaluation import Evaluation
from mfopt.records.level import Ladder, Level
from mfopt.records.objective import RETURNED, judged
from mfopt.records.problem import Constraint, Problem, Variable
from mfopt.search.search import (
    MOST_WORKERS,
    Reevaluate,
    Stage,
    check_work,
    default_population_size,
    rungs,
    window,
)
from mfopt.study.minimum import Minimum, minimum
from mfopt.study.searches import make_search

log = logging.getLogger(__name__)

RUNS_PER_VARIABLE = 10  # of a budget that is left out


def minimize(
    levels: Mapping[str, Simulator] | Sequence[Level],
    bounds: Mapping[str, tuple[float, float]],
    *,
    costs: Mapping[str, float] | None = None,
    budget: float | None = None,
    generations: Mapping[str, int] | int | None = None,
    start: ArrayLike | None = None,
    population_size: int | None = None,
    sigma: float = 0.2,
    seeds: int = 1,
    reevaluate: Reevaluate = "none",
    constraint: Constraint | None = None,
    seed: int = 1,
    workers: int = 1,
    directory: Path | str | None = None,
) -> Minimum:
    """Minimise over a ladder of simulators, coarse to fine.

    A surrogate learns from the runs at all levels. Only designs that it cannot predict well enough
    are run, and the level changes by itself. With `generations` it is CMA-ES with planned
    generations per level instead.

    Every level is run once at the start before anything else. The search learns from these runs,
    and they count in its budget.

    Args:
        levels: functions by name, `function(x, seed) -> float`, or `Level`s; cheapest first.
        bounds: lower and upper bound of each variable by name.
        costs: of one run by level, in any unit; for functions, and 1 for each if left out. A cost
            below 1/512 of the last level's counts as 1/512.
        budget: what the search may spend, in runs of the last level; 10 (d + 2) if left out.
        generations: of planned CMA-ES: per level, or the same for each.
        start: first design (d,); the middle of the bounds if left out.
        population_size: candidates per generation; 4 + 3 ln d if left out.
        sigma: first step size as a share of the bounds' width.
        seeds: for noisy simulators: generations rotate over so many seeds.
        reevaluate: runs candidates again whose ranking is in doubt, "ranks" or "elite" (see
            `mfopt.Stage`). Of planned CMA-ES.
        constraint: returns why a design is impossible, or None; such a design is never run.
        seed: of the search.
        workers: processes; with 1 the functions run here and need not be picklable.
        directory: keeps the run; given again, the run goes on from it, also with a larger budget
            or more generations. Whether the functions are still the same cannot be seen.

    Returns:
        The design that the search recommends, with the estimate of its value at the last level.

    Raises:
        ConfigError: if an argument is wrong, or `directory` holds another run.
        SimulationError: if the first runs of a level, at the start, all fail.
        MfoptError: if no run at the last level finished.
    """
    workers = whole("workers", workers, 1, MOST_WORKERS)
    ladder = Ladder(_as_levels(levels, costs))
    problem = _problem(bounds, start, constraint)
    costs_of_runs = rungs(ladder, problem.baseline)
    _check_way(budget, generations, reevaluate)
    plan: list[Stage] = []
    if generations is not None:
        plan = _plan(problem, ladder, generations, population_size, sigma, seeds, reevaluate)
    elif budget is None:
        budget = RUNS_PER_VARIABLE * (problem.dimension + 2)

    search_within = partial(
        make_search, problem, ladder, stages=plan, seed=seed, sigma=sigma,
        population_size=population_size, seeds=seeds,
    )  # fmt: skip
    search_within(
        budgets=[] if budget is None else [budget]
    )  # names wrong arguments before anything is written
    settings = {
        "population_size": None if population_size is None else int(population_size),
        "sigma": float(sigma), "seeds": int(seeds),
        "budget": None if budget is None else float(budget),
        "generations": {stage.level: int(stage.generations) for stage in plan},
        "reevaluate": reevaluate,
    }  # fmt: skip
    runner = Runner(local_processes(workers) if workers > 1 else one_thread)
    if workers > 1:
        runner.check(ladder)
    with scratch() as folder:
        path = folder / "run" if directory is None else _path(directory)
        with writing(path):
            run = begin(path, "", header(
                problem, ladder, name=path.name, seed=int(seed), objective="returned",
                method="cma-es" if plan else "assisted", workers=workers,
                settings={"search": settings},
            ), resume=True)  # fmt: skip
            if run.made:
                log.warning(
                    "the runs stored in %s are used; if a function has changed since, which cannot "
                    "be seen, give another directory", path,
                )  # fmt: skip
            within = budgets(run.header)
            search = search_within(budgets=within)
            checked: tuple[Evaluation, ...] = ()
            if not within or sum(rung.cost for rung in costs_of_runs) <= within[0]:
                planned = Ladder(tuple(ladder[stage.level] for stage in plan)) if plan else ladder
                judge = partial(judged, RETURNED)
                started = check_stored(run, planned, problem.baseline, runner, judge)
                checked = started.evaluations
            watched: list[Progress] = []
            best = run_study(
                problem, ladder, lambda _: search, runner, run, confirm_on=ladder, confirm_seeds=0,
                checked=checked, window=window(run.header["workers"]), watch=watched.append,
            )  # fmt: skip
            evaluations = _once(problem, run.evaluations())
            stored = len(evaluations) - sum(not its.replayed for its in watched)
    target = plan[-1].level if plan else ladder.top.name
    return minimum(problem, search, best, evaluations, target=target, stored=stored)


def _once(problem: Problem, evaluations: Iterable[Evaluation]) -> tuple[Evaluation, ...]:
    """The evaluations, but for those that the search took from the first run of a level."""
    first: set[Run] = set()
    kept = []
    for e in evaluations:
        run = run_of(problem, e.candidate)
        if e.candidate.purpose == "check":
            first.add(run)
        elif run in first:
            continue
        kept.append(e)
    return tuple(kept)


def _check_way(
    budget: float | None, generations: Mapping[str, int] | int | None, reevaluate: Reevaluate
) -> None:
    """Make sure that what is given belongs to one way of searching."""
    if generations is None:
        if reevaluate != "none":
            raise ConfigError(
                f"reevaluate = {shown(reevaluate)} is of planned CMA-ES; give generations, or "
                "leave reevaluate out"
            )
    elif budget is not None:
        raise ConfigError(
            f"budget = {shown(budget)} and generations = {shown(generations)} exclude each other: "
            "generations plan CMA-ES, a budget is of the search with a surrogate; give one of them"
        )


def _problem(
    bounds: Mapping[str, tuple[float, float]],
    start: ArrayLike | None,
    constraint: Constraint | None,
) -> Problem:
    """The problem, from the middle of the bounds if no start is given."""
    if not isinstance(bounds, Mapping):
        raise ConfigError(
            f"bounds = {shown(bounds)} must give lower and upper bound by name, such as "
            '{"a": (0, 1)}'
        )
    if constraint is not None and not callable(constraint):
        raise ConfigError(f"constraint = {shown(constraint)} must be a function of x")
    variables = []
    for name, limits in bounds.items():
        try:
            lower, upper = limits
        except (TypeError, ValueError):
            raise ConfigError(
                f"bounds: {name} = {shown(limits)} must be a pair (lower, upper)"
            ) from None
        variables.append(Variable(name, lower, upper))
    if start is None:
        return Problem(tuple(variables), frozen([v.middle for v in variables]), constraint)
    try:
        x = np.asarray(start)
    except ValueError:
        x = np.empty(0, dtype=object)
    if x.ndim != 1 or x.dtype.kind not in "iuf":
        raise ConfigError(f"start = {shown(start)} must be a list of one number a variable")
    return Problem(tuple(variables), frozen(x), constraint)


def _path(directory: Path | str) -> Path:
    if not isinstance(directory, Path | str) or not str(directory) or "\0" in str(directory):
        raise ConfigError(f"directory = {shown(directory)} must be a path")
    return Path(directory)


def _plan(
    problem: Problem,
    ladder: Ladder,
    generations: Mapping[str, int] | int,
    population_size: int | None,
    sigma: float,
    seeds: int,
    reevaluate: Reevaluate,
) -> list[Stage]:
    """The stages of the planned search."""
    if population_size is None:
        population_size = default_population_size(problem.dimension)
    plan = (
        generations
        if isinstance(generations, Mapping)
        else dict.fromkeys(ladder.names, generations)
    )
    if not plan:
        raise ConfigError("generations = {} plans nothing; give a number for at least one level")
    return [
        Stage(ladder[name].name, count, population_size, sigma, "returned", seeds, reevaluate)
        for name, count in plan.items()
    ]


def _as_levels(
    levels: Mapping[str, Simulator] | Sequence[Level], costs: Mapping[str, float] | None
) -> tuple[Level, ...]:
    if not isinstance(levels, Mapping):
        if costs is not None:
            raise ConfigError("costs are for functions; a Level says its own work")
        return _checked(levels)
    given = dict.fromkeys(levels, 1.0) if costs is None else costs
    if not isinstance(given, Mapping):
        raise ConfigError(f"costs = {shown(given)} must give a number by level")
    if set(given) != set(levels):
        raise ConfigError(
            f"costs are given for {', '.join(map(str, given))}, the levels are "
            f"{', '.join(map(str, levels))}; give one for each"
        )
    for name, cost in given.items():
        check_work(f"costs: {name}", cost)
    return tuple(FunctionLevel(name, f, given[name]) for name, f in levels.items())


def _checked(levels: Sequence[Level]) -> tuple[Level, ...]:
    """The levels, if they are some."""
    if not isinstance(levels, Sequence) or isinstance(levels, str | bytes):
        raise ConfigError(
            f"levels = {shown(levels)} must be functions by name, such as "
            '{"fine": f}, or a list of levels'
        )
    for level in levels:
        for part in ("name", "work", "evaluate"):
            if isinstance(level, type) or not hasattr(level, part):
                raise ConfigError(
                    f"level {shown(level)} is no Level: it needs a name, work(x) and evaluate(x, "
                    "seed=...); functions are given by name"
                )
    return tuple(levels)
