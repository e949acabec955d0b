"""The driver of a study: runs what is asked for, stores it, and tells.

Resuming replays a search from its seed. A candidate that the run directory already holds is told
from there, and only the others are run. A search is a pure function of its seed and of the values
that it is told, so a resumed run ends with the evaluations of an undisturbed one.
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mfopt.campaign.executor import Runner
from mfopt.campaign.memory import Memory
from mfopt.records.evaluation import Candidate, Evaluation, Insight
from mfopt.records.level import Ladder
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


@dataclass(frozen=True, slots=True)
class Driver:
    """Runs what is asked for, stores it, and tells; what was run before is not run again.

    Searches, confirmation and every other phase of a study ask it.
    """

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

    def search(self, search: Search, ladder: Ladder, first_index: int) -> list[Evaluation]:
        """Ask and tell until the search stops; evaluations in the order asked.

        Results are told in the order asked, whichever ends first, so that a run repeats exactly. At
        most `window` candidates are out at a time: those that exceed the workers keep them busy
        while a slow run ends.

        Args:
            first_index: evaluations of the run that were made before.
        """
        memory, runner = self.memory, self.runner
        criteria = memory.run.criteria
        made: list[Evaluation] = []
        out: deque[tuple[Candidate, Candidate]] = deque()  # as the search knows it, and as stored
        arrived: dict[int, Evaluation] = {}
        objectives: dict[int, Objective] = {}
        while True:
            while len(out) < self.window and search.should_stop() is None:
                generation = search.generation
                asked = search.ask(self.window - len(out))
                if not asked:
                    break
                memory.run.add_generation(generation)
                for its in asked:
                    candidate = replace(its, index=first_index + its.index)
                    out.append((its, candidate))
                    objectives[candidate.index] = criteria.objective(generation.objective)
                    found = self.known(candidate, objectives[candidate.index])
                    if found is not None:
                        arrived[candidate.index] = found
                        self.watch(Progress(found, search.work_left, True, search.insight))
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
                self.watch(Progress(new, search.work_left, False, search.insight))
            evaluation = arrived.pop(candidate.index)
            terms = missed(objectives[candidate.index], [evaluation.outcome])
            search.tell([its], [evaluation.objective], terms)
            if search.insight is not None:
                memory.run.add_insight(search.insight)
            made.append(evaluation)


def run_of(problem: Problem, candidate: Candidate) -> Run:
    """What a run depends on; designs that differ by rounding are the same."""
    z = np.round(problem.to_z(candidate.x), SAME_DESIGN) + 0.0  # no -0.0
    return candidate.level, candidate.seed, z.tobytes()
