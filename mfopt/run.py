"""The loop: ask, evaluate, store, tell; then confirm the best design over fresh seeds.

A study may ask that best and baseline are run once more on another engine, the reference.

Resuming replays the search from its seed. A candidate that the run directory already holds
is told from there, only the others are run. A search is a pure function of its seed and of
the values it is told, so the resumed run ends with the evaluations of an undisturbed one.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mfopt.arrays import Array
from mfopt.evaluation import Candidate, Evaluation, Purpose
from mfopt.executor import Runner
from mfopt.level import Ladder, Level
from mfopt.memory import Memory
from mfopt.objective import Objective, counts, objective_named, value
from mfopt.problem import Problem
from mfopt.search import Search
from mfopt.store import RunDirectory

CONFIRM_SEED = 1_000_000  # far from the search's seeds, so that confirmation is fresh


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a run has come, after each evaluation."""

    evaluation: Evaluation
    runs_left: Sequence[tuple[str, int]]  # (level, number of runs) still planned
    replayed: bool  # taken from the run directory, not run now


Watch = Callable[[Progress], None]


def run_study(
    problem: Problem,
    ladder: Ladder,
    search: Search,
    runner: Runner,
    run: RunDirectory,
    *,
    confirm_on: Ladder,
    confirm_seeds: int,
    window: int = 1,
    reference: Level | None = None,
    watch: Watch = lambda progress: None,
) -> Evaluation | None:
    """Run or resume a study until its search and the confirmation have ended.

    Args:
        confirm_on: ladder for the confirmation, e.g. with snapshots switched on.
        confirm_seeds: fresh seeds for the best and the baseline design.
        window: candidates that may be out at a time; a resumed run needs the same.
        reference: where both are run once more, with the first of these seeds.

    Returns:
        An evaluation of the recommended design, at the highest level that has one.
    """
    memory = Memory(run)
    try:
        made = _search(search, memory, ladder, runner, window, watch)
        best = best_of(made, ladder, search.recommended())
        if best is not None and confirm_seeds:
            x, top = best.candidate.x, ladder.top.name
            pairs = confirmation(problem, x, top, confirm_seeds, len(made))
            objective = objective_named(search.generation.objective)
            _evaluate(pairs, memory, confirm_on, runner, objective, watch)
            if reference is not None:
                pair = on_reference(pairs, reference.name)
                _evaluate(pair, memory, Ladder((reference,)), runner, objective, watch)
        if run.end is None:
            run.add_end(search.should_stop() or "")
    finally:
        runner.close()
    return best


def _search(
    search: Search, memory: Memory, ladder: Ladder, runner: Runner, window: int, watch: Watch
) -> list[Evaluation]:
    """Ask and tell until the search stops; evaluations in the order asked.

    Results are told in the order asked, whichever ends first, so that a run repeats exactly. At
    most `window` candidates are out at a time: those that exceed the workers keep them busy
    while a slow run ends.
    """
    made: list[Evaluation] = []
    out: deque[Candidate] = deque()
    arrived: dict[int, Evaluation] = {}
    objectives: dict[int, Objective] = {}
    while True:
        while len(out) < window and search.should_stop() is None:
            generation = search.generation
            candidates = search.ask(window - len(out))
            if not candidates:
                break
            memory.run.add_generation(generation)
            for candidate in candidates:
                out.append(candidate)
                objectives[candidate.index] = objective_named(generation.objective)
                if (found := memory.recall(candidate)) is not None:
                    arrived[candidate.index] = found
                    watch(Progress(found, search.work_left, replayed=True))
                else:
                    runner.submit(ladder, candidate)
        if not out:
            return made
        candidate = out.popleft()
        while candidate.index not in arrived:
            other, outcome = runner.next()
            new = Evaluation(other, outcome, value(objectives[other.index], outcome))
            memory.run.add_evaluation(new)
            arrived[other.index] = new
            watch(Progress(new, search.work_left, replayed=False))
        evaluation = arrived.pop(candidate.index)
        terms = counts(objectives[candidate.index], [evaluation.outcome])
        search.tell([candidate], [evaluation.objective], terms)
        if search.insight is not None:
            memory.run.add_insight(search.insight)
        made.append(evaluation)


def confirmation(
    problem: Problem, x: Array, level: str, seeds: int, first_index: int
) -> list[Candidate]:
    """Runs of the best and the baseline design on the same fresh seeds."""
    designs: list[tuple[Purpose, Array]] = [
        ("confirm best", x),
        ("confirm baseline", problem.baseline),
    ]
    plan = [(purpose, x, seed) for seed in range(seeds) for purpose, x in designs]
    return [
        Candidate(first_index + n, x, level, CONFIRM_SEED + seed, 0, purpose)
        for n, (purpose, x, seed) in enumerate(plan)
    ]


def on_reference(confirmation: Sequence[Candidate], level: str) -> list[Candidate]:
    """The confirmation of its first seed once more, on the reference level."""
    after: dict[Purpose, Purpose] = {
        "confirm best": "reference best",
        "confirm baseline": "reference baseline",
    }
    index = confirmation[-1].index + 1
    return [
        replace(c, index=index + n, level=level, purpose=after[c.purpose])
        for n, c in enumerate(c for c in confirmation if c.seed == CONFIRM_SEED)
    ]


def best_of(
    evaluations: Sequence[Evaluation], ladder: Ladder, recommended: Array | None = None
) -> Evaluation | None:
    """The evaluation of the recommended design at the highest level that it has finished on.

    Without a recommendation, the lowest objective at the highest level that any run has.
    """
    search_runs = [e for e in evaluations if e.outcome.finished]
    if recommended is not None:
        own = [e for e in search_runs if np.array_equal(e.candidate.x, recommended)]
        search_runs = own or search_runs
    for level in reversed(ladder.names):
        there = [e for e in search_runs if e.candidate.level == level]
        if there:
            return min(there, key=lambda e: e.objective)
    return None


def _evaluate(
    candidates: Sequence[Candidate],
    memory: Memory,
    ladder: Ladder,
    runner: Runner,
    objective: Objective,
    watch: Watch,
) -> None:
    """Evaluate what is not in the run directory yet."""
    known = {c.index: found for c in candidates if (found := memory.recall(c)) is not None}
    for found in known.values():
        watch(Progress(found, [], replayed=True))
    missing = [c for c in candidates if c.index not in known]
    for candidate, outcome in runner.run(ladder, missing):
        new = Evaluation(candidate, outcome, value(objective, outcome))
        memory.run.add_evaluation(new)
        watch(Progress(new, [], replayed=False))
