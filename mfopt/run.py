"""The loop: ask, evaluate, store, tell; then confirm the best design over fresh seeds.

A study may ask that best and baseline are run once more on another engine, the reference.

Resuming replays the search from its seed. A candidate that the run directory already holds
is told from there, only the others are run. A search is a pure function of its seed and of
the values it is told, so the resumed run ends with the evaluations of an undisturbed one.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from mfopt.arrays import Array
from mfopt.errors import ConfigError
from mfopt.evaluation import Candidate, Evaluation, Purpose
from mfopt.executor import Runner
from mfopt.level import Ladder, Level
from mfopt.objective import Objective, objective_named, value
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


@dataclass(frozen=True, slots=True)
class Memory:
    """Evaluations of one run: those on disk are used again, new ones are added."""

    run: RunDirectory
    known: dict[int, Evaluation]

    def recall(self, candidate: Candidate) -> Evaluation | None:
        """The stored evaluation of a candidate.

        Raises:
            ConfigError: if the directory holds another design under its number.
        """
        found = self.known.get(candidate.index)
        if found is None:
            return None
        stored = found.candidate
        same = (stored.level, stored.seed, stored.purpose) == (
            candidate.level, candidate.seed, candidate.purpose,
        )  # fmt: skip
        if not (same and np.array_equal(stored.x, candidate.x)):
            raise ConfigError(
                f"{self.run.path}: evaluation {candidate.index} is of another design than this "
                "search asks for; it was made by another version or another study, so start "
                "a new run directory"
            )
        return found


def run_study(
    problem: Problem,
    ladder: Ladder,
    search: Search,
    runner: Runner,
    run: RunDirectory,
    *,
    confirm_on: Ladder,
    confirm_seeds: int,
    reference: Level | None = None,
    watch: Watch = lambda progress: None,
) -> Evaluation | None:
    """Run or resume a study until its search and the confirmation have ended.

    Args:
        confirm_on: ladder for the confirmation, e.g. with snapshots switched on.
        confirm_seeds: fresh seeds for the best and the baseline design.
        reference: where both are run once more, with the first of these seeds.

    Returns:
        The best evaluation of the search at the highest level that has one.
    """
    memory = Memory(run, {e.candidate.index: e for e in run.evaluations()})
    made: list[Evaluation] = []
    asked = 0
    try:
        while search.should_stop() is None:
            generation = search.generation
            run.add_generation(generation)
            candidates = search.ask()
            asked += len(candidates)
            left = search.work_left
            objective = objective_named(generation.objective)
            evaluations = _evaluate(candidates, memory, ladder, runner, objective, left, watch)
            search.tell(candidates, [e.objective for e in evaluations])
            made += evaluations
        best = best_of(made, ladder)
        if best is not None and confirm_seeds:
            pairs = confirmation(problem, best.candidate.x, ladder.top.name, confirm_seeds, asked)
            _evaluate(pairs, memory, confirm_on, runner, objective, [], watch)
            if reference is not None:
                pair = on_reference(pairs, reference.name)
                _evaluate(pair, memory, Ladder((reference,)), runner, objective, [], watch)
        if run.end is None:
            run.add_end(search.should_stop() or "")
    finally:
        runner.close()
    return best


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


def best_of(evaluations: Sequence[Evaluation], ladder: Ladder) -> Evaluation | None:
    """The lowest objective at the highest level that a search run has finished on."""
    for level in reversed(ladder.names):
        there = [e for e in evaluations if e.candidate.level == level and e.outcome.finished]
        if there:
            return min(there, key=lambda e: e.objective)
    return None


def _evaluate(
    candidates: Sequence[Candidate],
    memory: Memory,
    ladder: Ladder,
    runner: Runner,
    objective: Objective,
    left: Sequence[tuple[str, int]],
    watch: Watch,
) -> list[Evaluation]:
    """Evaluate candidates, each from the run directory or by a run; in the order asked."""
    known = [found for c in candidates if (found := memory.recall(c)) is not None]
    missing = [c for c in candidates if c.index not in memory.known]
    done: dict[int, Evaluation] = {}
    for evaluation in chain(known, _made(missing, ladder, runner, objective)):
        replayed = evaluation.candidate.index in memory.known
        if not replayed:
            memory.run.add_evaluation(evaluation)
        done[evaluation.candidate.index] = evaluation
        watch(Progress(evaluation, _less(left, len(done)), replayed))
    return [done[c.index] for c in candidates]


def _made(
    candidates: Sequence[Candidate], ladder: Ladder, runner: Runner, objective: Objective
) -> Iterator[Evaluation]:
    for candidate, outcome in runner.run(ladder, candidates):
        yield Evaluation(candidate, outcome, value(objective, outcome))


def _less(left: Sequence[tuple[str, int]], done: int) -> list[tuple[str, int]]:
    """The planned runs with those done of the present generation taken off."""
    return [(level, n - done * (place == 0)) for place, (level, n) in enumerate(left)]
