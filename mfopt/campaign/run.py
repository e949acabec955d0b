"""The loop: check and starts, then ask, evaluate, store, tell; then finalists and confirmation.

Resuming replays the search from its seed. A candidate that the run directory already holds
is told from there, only the others are run. A search is a pure function of its seed and of
the values it is told, so the resumed run ends with the evaluations of an undisturbed one.
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mfopt.arrays import Array, distinct
from mfopt.campaign.executor import Runner
from mfopt.campaign.memory import Memory
from mfopt.campaign.phases import (
    NO_FINALS,
    Finals,
    Starts,
    by_mean,
    confirmation,
    finalists,
    on_reference,
)
from mfopt.campaign.store import RunDirectory
from mfopt.records.evaluation import Candidate, Evaluation, Insight
from mfopt.records.level import Ladder, Level
from mfopt.records.objective import Objective, judged, missed
from mfopt.records.outcome import Outcome
from mfopt.records.problem import Problem
from mfopt.search.search import Search


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a run has come, after each evaluation."""

    evaluation: Evaluation
    runs_left: Sequence[tuple[str, int]]  # (level, number of runs) that the search still plans
    replayed: bool  # taken from the run directory, not run now
    insight: Insight | None = None  # what the search knows of its recommended design


Watch = Callable[[Progress], None]
Run = tuple[str, int, bytes]  # level, seed and design: what a run gives depends on nothing else
SAME_DESIGN = 12  # decimals in the unit cube
MakeSearch = Callable[[Array], Search]  # the search that starts from a design (d,)


@dataclass(frozen=True, slots=True)
class _Loop:
    """What every phase needs to have its candidates evaluated."""

    problem: Problem
    memory: Memory
    runner: Runner
    window: int
    watch: Watch
    checked: Mapping[Run, Outcome]  # what the check of the levels has run

    def known(self, candidate: Candidate, objective: Objective) -> Evaluation | None:
        """The evaluation of a candidate that need not be run: stored, or run by the check."""
        found = self.memory.recall(candidate)
        if found is not None:
            return found
        outcome = self.checked.get(run_of(self.problem, candidate))
        if outcome is None:
            return None
        free = replace(outcome, work=0.0, cpu_s=0.0)  # the check has spent it
        found = Evaluation(candidate, *judged(objective, free))
        self.memory.run.add_evaluation(found)
        return found

    def keep(self, made: Sequence[Evaluation]) -> None:
        """Store evaluations that were made outside of the loop, unless they are there."""
        for evaluation in made:
            known = self.memory.recall(evaluation.candidate) is not None
            if not known:
                self.memory.run.add_evaluation(evaluation)
            self.watch(Progress(evaluation, [], replayed=known))

    def evaluate(
        self, candidates: Sequence[Candidate], ladder: Ladder, objective_name: str
    ) -> list[Evaluation]:
        """Evaluate what is not in the run directory yet; all in the order given."""
        objective = self.memory.run.criteria.objective(objective_name)
        made = {
            c.index: found for c in candidates if (found := self.known(c, objective)) is not None
        }
        for found in made.values():
            self.watch(Progress(found, [], replayed=True))
        missing = [c for c in candidates if c.index not in made]
        for candidate, outcome in self.runner.run(ladder, missing):
            new = made[candidate.index] = Evaluation(candidate, *judged(objective, outcome))
            self.memory.run.add_evaluation(new)
            self.watch(Progress(new, [], replayed=False))
        return [made[c.index] for c in candidates]


def run_study(
    problem: Problem,
    ladder: Ladder,
    make_search: MakeSearch,
    runner: Runner,
    run: RunDirectory,
    *,
    confirm_on: Ladder,
    confirm_seeds: int,
    objective: str = "returned",
    checked: Sequence[Evaluation] = (),
    starts: Starts | None = None,
    finals: Finals = NO_FINALS,
    window: int = 1,
    reference: Level | None = None,
    watch: Watch = lambda progress: None,
) -> Evaluation | None:
    """Run or resume a study until its search and the confirmation have ended.

    Args:
        make_search: makes the search that starts from a design.
        confirm_on: ladder for the confirmation, e.g. with snapshots switched on.
        confirm_seeds: fresh seeds for the best and the baseline design.
        objective: that ranks starts, finalists and the confirmation.
        checked: whole runs that the check of the levels has made, numbered from 0. The search
            learns from them, and none is made again.
        starts: designs of which the best is where the search starts; the baseline if None.
        finals: how the best design is told from its rivals; with starts, the best of these and the
            baseline are rivals too.
        window: candidates that may be out at a time; a resumed run needs the same.
        reference: where both are run once more, with the first of these seeds.

    Returns:
        An evaluation of the best design, at the highest level that has one.
    """
    at_check = {run_of(problem, e.candidate): e.outcome for e in checked}
    loop = _Loop(problem, Memory(run), runner, window, watch, at_check)
    try:
        loop.keep(checked)
        first = [] if starts is None else starts.candidates(len(checked))
        before = [*checked, *loop.evaluate(first, ladder, objective)]
        start = next(iter(by_mean(before[len(checked) :])), None)
        search = make_search(problem.baseline if start is None else start)
        told = list({run_of(problem, e.candidate): e for e in before}.values())
        if told:
            search.tell(
                [e.candidate for e in told],
                [e.objective for e in told],
                missed(run.criteria.objective(objective), [e.outcome for e in told]),
            )
        made = [*before, *_search(search, loop, ladder, len(before))]
        top = ladder.top.name
        rivals = search.finalists(finals.designs)
        if start is not None:
            rivals = [*rivals, start, problem.baseline]
        final, winner = _tell_apart(distinct(rivals), finals, loop, ladder, objective, len(made))
        made += final
        best = best_of(made, ladder, search.recommended() if winner is None else winner)
        if best is not None and confirm_seeds:
            pairs = confirmation(problem, best.candidate.x, top, confirm_seeds, len(made))
            loop.evaluate(pairs, confirm_on, objective)
            if reference is not None:
                pair = on_reference(pairs, reference.name)
                loop.evaluate(pair, Ladder((reference,)), objective)
        if run.end is None:
            run.add_end(search.should_stop() or "")
    finally:
        runner.close()
    return best


def _search(search: Search, loop: _Loop, ladder: Ladder, first_index: int) -> list[Evaluation]:
    """Ask and tell until the search stops; evaluations in the order asked.

    Results are told in the order asked, whichever ends first, so that a run repeats exactly. At
    most `window` candidates are out at a time: those that exceed the workers keep them busy
    while a slow run ends.

    Args:
        first_index: evaluations of the run that were made before.
    """
    memory, runner = loop.memory, loop.runner
    made: list[Evaluation] = []
    out: deque[tuple[Candidate, Candidate]] = deque()  # as the search knows it, and as stored
    arrived: dict[int, Evaluation] = {}
    objectives: dict[int, Objective] = {}
    while True:
        while len(out) < loop.window and search.should_stop() is None:
            generation = search.generation
            asked = search.ask(loop.window - len(out))
            if not asked:
                break
            memory.run.add_generation(generation)
            for its in asked:
                candidate = replace(its, index=first_index + its.index)
                out.append((its, candidate))
                objectives[candidate.index] = memory.run.criteria.objective(generation.objective)
                found = loop.known(candidate, objectives[candidate.index])
                if found is not None:
                    arrived[candidate.index] = found
                    loop.watch(Progress(found, search.work_left, True, search.insight))
                else:
                    runner.submit(ladder, candidate)
        if not out:
            return made
        its, candidate = out.popleft()
        while candidate.index not in arrived:
            other, outcome = runner.next()
            new = Evaluation(other, *judged(objectives[other.index], outcome))
            memory.run.add_evaluation(new)
            arrived[other.index] = new
            loop.watch(Progress(new, search.work_left, False, search.insight))
        evaluation = arrived.pop(candidate.index)
        terms = missed(objectives[candidate.index], [evaluation.outcome])
        search.tell([its], [evaluation.objective], terms)
        if search.insight is not None:
            memory.run.add_insight(search.insight)
        made.append(evaluation)


def _tell_apart(
    rivals: Sequence[Array],
    finals: Finals,
    loop: _Loop,
    ladder: Ladder,
    objective: str,
    first_index: int,
) -> tuple[list[Evaluation], Array | None]:
    """Run the rivals at the target in rounds; these runs, and the rival (d,) that is left."""
    made: list[Evaluation] = []
    seeds, used = finals.seeds, 0
    while len(rivals) > 1:
        index = first_index + len(made)
        round_ = finalists(rivals, ladder.top.name, used, seeds, index)
        made += loop.evaluate(round_, ladder, objective)
        left = {x.tobytes() for x in rivals}
        its = [e for e in made if e.candidate.x.tobytes() in left]
        rivals = by_mean(its)[: len(rivals) // 2]
        seeds, used = 2 * seeds, used + seeds
    return made, rivals[0] if rivals else None


def run_of(problem: Problem, candidate: Candidate) -> Run:
    """What a run depends on; designs that differ by rounding are the same."""
    z = np.round(problem.to_z(candidate.x), SAME_DESIGN) + 0.0  # no -0.0
    return candidate.level, candidate.seed, z.tobytes()


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
