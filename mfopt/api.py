"""`minimize`: the user's own simulators over a ladder of levels, in one call."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from numpy.typing import ArrayLike

from mfopt.arrays import Array, frozen
from mfopt.assisted import AssistedCmaEs
from mfopt.begin import begin
from mfopt.cmaes import CmaEs
from mfopt.errors import ConfigError, MfoptError
from mfopt.evaluation import Evaluation
from mfopt.executor import Runner, one_thread
from mfopt.function_level import FunctionLevel, Simulator
from mfopt.header import header
from mfopt.level import Ladder, Level
from mfopt.local_workers import local_processes
from mfopt.outcome import LARGEST_WORK, SMALLEST_WORK
from mfopt.problem import Constraint, Problem, Variable
from mfopt.run import run_study
from mfopt.scratch import scratch
from mfopt.search import Reevaluate, Search, Stage, default_population_size, rungs, window
from mfopt.store import writing
from mfopt.surrogate import Surrogate

GENERATIONS = 30  # per level of a plan that names none


@dataclass(frozen=True, slots=True, eq=False)
class Minimum:
    """What `minimize` found: the recommended design, and every run made."""

    x: Array  # (d,)
    f: float
    level: str
    why: str  # why the search ended
    evaluations: tuple[Evaluation, ...]


def minimize(
    levels: Mapping[str, Simulator] | Sequence[Level],
    bounds: Mapping[str, tuple[float, float]],
    *,
    generations: Mapping[str, int] | int | None = None,
    surrogate: Surrogate | None = None,
    budget: float | None = None,
    costs: Mapping[str, float] | None = None,
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

    With a surrogate, such as `surrogates.autoregressive.AutoregressiveGp()`, and a budget it runs
    only what the surrogate cannot predict, and changes the level by itself; without, it is
    CMA-ES with planned generations per level.

    Args:
        levels: functions by name, `function(x, seed) -> float`, or `Level`s; cheapest first.
        bounds: lower and upper bound of each variable by name.
        generations: per level, or the same for each; 30 if left out. Without a surrogate.
        surrogate: learns from the runs at all levels.
        budget: what the search may spend, in runs of the last level. With a surrogate.
        costs: of one run by level, in any unit; for functions, and 1 for each if left out.
        start: first design (d,); the middle of the bounds if left out.
        population_size: candidates per generation; 4 + 3 ln d if left out.
        sigma: first step size as a share of the bounds' width.
        seeds: for noisy simulators: generations rotate over so many seeds.
        reevaluate: runs candidates again whose ranking is in doubt, "ranks" or "elite" (see
            `mfopt.Stage`). Without a surrogate.
        constraint: returns why a design is impossible, or None; such a design is never run.
        seed: of the search.
        workers: processes; with 1 the functions run here and need not be picklable.
        directory: keeps the run; given again, the run is resumed from it.

    Returns:
        The design that the search recommends, with its value at the highest level that has one.

    Raises:
        ConfigError: if an argument is wrong, or `directory` holds another run.
        MfoptError: if no run finished.
    """
    ladder = Ladder(_as_levels(levels, costs))
    variables = tuple(Variable(name, *limits) for name, limits in bounds.items())
    middle = [(v.lower + v.upper) / 2.0 for v in variables]
    problem = Problem(variables, frozen(middle if start is None else start), constraint)
    search: Search
    if surrogate is None:
        if budget is not None:
            raise ConfigError(
                f"budget = {budget:g} needs a surrogate; give one, or generations in its place"
            )
        size = population_size or default_population_size(problem.dimension)
        plan = _plan(ladder, generations, size, sigma, seeds, reevaluate)
        search = CmaEs(problem, plan, seed=seed)

    else:
        if reevaluate != "none":
            raise ConfigError(
                f'reevaluate = "{reevaluate}" is for the search without a surrogate; leave one out'
            )
        if budget is None or generations is not None:
            raise ConfigError(
                "a surrogate needs a budget, in runs of the last level, and no generations: it "
                "changes the level by itself"
            )
        search = AssistedCmaEs(
            problem, rungs(ladder, problem.baseline), surrogate, budget=budget, seed=seed,
            sigma=sigma, population_size=population_size, seeds=seeds,
        )  # fmt: skip
    runner = Runner(local_processes(workers) if workers > 1 else one_thread)
    if workers > 1:
        runner.check(ladder)
    with scratch() as folder:
        path = Path(directory) if directory is not None else folder / "run"
        with writing(path):
            now = header(
                problem, ladder, name=path.name, seed=seed, objective="returned",
                method="cma-es" if surrogate is None else "assisted", workers=workers,
            )  # fmt: skip
            run = begin(path, "", now, resume=True)
            best = run_study(
                problem, ladder, lambda _: search, runner, run, confirm_on=ladder, confirm_seeds=0,
                window=window(run.header["workers"]),
            )  # fmt: skip
            evaluations = tuple(run.evaluations())
    if best is None:
        raise MfoptError(f"no run finished; the first failed with: {evaluations[0].outcome.why}")
    why = search.should_stop() or ""
    return Minimum(best.candidate.x, best.objective, best.candidate.level, why, evaluations)


def _plan(
    ladder: Ladder,
    generations: Mapping[str, int] | int | None,
    population_size: int,
    sigma: float,
    seeds: int,
    reevaluate: Reevaluate,
) -> list[Stage]:
    """The stages of the planned search."""
    same = GENERATIONS if generations is None else generations
    plan = same if isinstance(same, Mapping) else dict.fromkeys(ladder.names, same)
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
        return tuple(levels)
    given = dict.fromkeys(levels, 1.0) if costs is None else costs
    if set(given) != set(levels):
        raise ConfigError(
            f"costs are given for {', '.join(given)}, the levels are {', '.join(levels)}; "
            "give one for each"
        )
    for name, cost in given.items():
        if not SMALLEST_WORK <= cost <= LARGEST_WORK:
            raise ConfigError(
                f"costs: {name} = {cost} must be a number from {SMALLEST_WORK:g} to "
                f"{LARGEST_WORK:g}"
            )
    return tuple(FunctionLevel(name, f, given[name]) for name, f in levels.items())
