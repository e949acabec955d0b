"""`minimize`: the user's own simulators over a ladder of levels, in one call."""

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from mfopt.arrays import Array, frozen
from mfopt.cmaes import CmaEs
from mfopt.errors import MfoptError
from mfopt.evaluation import Evaluation
from mfopt.executor import Runner, local_processes, one_thread
from mfopt.function_level import FunctionLevel, Simulator
from mfopt.header import header
from mfopt.level import Ladder, Level
from mfopt.problem import Constraint, Problem, Variable
from mfopt.run import best_of, run_study
from mfopt.search import Stage
from mfopt.store import create, open_run, writing


@dataclass(frozen=True, slots=True, eq=False)
class Minimum:
    """What `minimize` found: the best design at the highest level, and every run made."""

    x: Array  # (d,)
    f: float
    level: str
    why: str  # why the search ended
    evaluations: tuple[Evaluation, ...]


def minimize(
    levels: Mapping[str, Simulator] | Sequence[Level],
    bounds: Mapping[str, tuple[float, float]],
    *,
    generations: Mapping[str, int] | int = 30,
    start: ArrayLike | None = None,
    population_size: int | None = None,
    sigma: float = 0.2,
    seeds: int = 1,
    constraint: Constraint | None = None,
    seed: int = 1,
    workers: int = 1,
    directory: Path | str | None = None,
) -> Minimum:
    """Minimise over a ladder of simulators, coarse to fine, by CMA-ES.

    Args:
        levels: functions by name, `function(x, seed) -> float`, or `Level`s; cheapest first.
        bounds: lower and upper bound of each variable by name.
        generations: per level, or the same for each.
        start: first design (d,); the middle of the bounds if left out.
        population_size: candidates per generation; 4 + 3 ln d if left out.
        sigma: first step size as a share of the bounds' width.
        seeds: for noisy simulators: generations rotate over so many seeds.
        constraint: returns why a design is impossible, or None; such a design is never run.
        seed: of the search.
        workers: processes; with 1 the functions run here and need not be picklable.
        directory: keeps the run; given again, the run is resumed from it.

    Raises:
        ConfigError: if an argument is wrong, or `directory` holds another run.
        MfoptError: if no run finished.
    """
    ladder = Ladder(_as_levels(levels))
    variables = tuple(Variable(name, *limits) for name, limits in bounds.items())
    middle = [(v.lower + v.upper) / 2.0 for v in variables]
    problem = Problem(variables, frozen(middle if start is None else start), constraint)
    size = population_size or 4 + int(3 * np.log(problem.dimension))
    plan = generations if isinstance(generations, Mapping) else dict.fromkeys(
        ladder.names, generations
    )  # fmt: skip
    stages = [Stage(ladder[n].name, g, size, sigma, "returned", seeds) for n, g in plan.items()]
    search = CmaEs(problem, stages, seed=seed)
    runner = Runner(local_processes(workers) if workers > 1 else one_thread)
    with tempfile.TemporaryDirectory(prefix="mfopt-") as scratch:
        path = Path(directory) if directory is not None else Path(scratch) / "run"
        if not (path / "run.json").exists():
            create(path, "", header(problem, ladder, name=path.name, seed=seed,
                                    objective="returned", workers=workers))  # fmt: skip
        with writing(path):
            run = open_run(path)
            run_study(problem, ladder, search, runner, run, confirm_on=ladder, confirm_seeds=0)
            evaluations = tuple(run.evaluations())
    best = best_of(evaluations, ladder)
    if best is None:
        raise MfoptError(f"no run finished; the first failed with: {evaluations[0].outcome.why}")
    why = search.should_stop() or ""
    return Minimum(best.candidate.x, best.objective, best.candidate.level, why, evaluations)


def _as_levels(levels: Mapping[str, Simulator] | Sequence[Level]) -> tuple[Level, ...]:
    if isinstance(levels, Mapping):
        return tuple(FunctionLevel(name, function) for name, function in levels.items())
    return tuple(levels)
