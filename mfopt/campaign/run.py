"""A study from its check to its confirmation: what the driver is asked for, in which order."""

from collections.abc import Callable, Sequence

import numpy as np

from mfopt.arrays import Array, distinct
from mfopt.campaign.driver import Driver, Watch, run_of
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
from mfopt.records.evaluation import Evaluation
from mfopt.records.level import Ladder, Level
from mfopt.records.objective import missed
from mfopt.records.problem import Problem
from mfopt.search.search import Search

MakeSearch = Callable[[Array], Search]  # the search that starts from a design (d,)


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
    driver = Driver(problem, Memory(run), runner, window, watch, at_check)
    try:
        driver.keep(checked)
        first = [] if starts is None else starts.candidates(len(checked))
        before = [*checked, *driver.evaluate(first, ladder, objective)]
        start = next(iter(by_mean(before[len(checked) :])), None)
        search = make_search(problem.baseline if start is None else start)
        told = list({run_of(problem, e.candidate): e for e in before}.values())
        if told:
            search.tell(
                [e.candidate for e in told],
                [e.objective for e in told],
                missed(run.criteria.objective(objective), [e.outcome for e in told]),
            )
        made = [*before, *driver.search(search, ladder, len(before))]
        top = ladder.top.name
        rivals = search.finalists(finals.designs)
        if start is not None:
            rivals = [*rivals, start, problem.baseline]
        final, winner = _tell_apart(distinct(rivals), finals, driver, ladder, objective, len(made))
        made += final
        best = best_of(made, ladder, search.recommended() if winner is None else winner)
        if best is not None and confirm_seeds:
            pairs = confirmation(problem, best.candidate.x, top, confirm_seeds, len(made))
            driver.evaluate(pairs, confirm_on, objective)
            if reference is not None:
                pair = on_reference(pairs, reference.name)
                driver.evaluate(pair, Ladder((reference,)), objective)
        if run.end is None:
            run.add_end(search.should_stop() or "")
    finally:
        runner.close()
    return best


def _tell_apart(
    rivals: Sequence[Array],
    finals: Finals,
    driver: Driver,
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
        made += driver.evaluate(round_, ladder, objective)
        left = {x.tobytes() for x in rivals}
        its = [e for e in made if e.candidate.x.tobytes() in left]
        rivals = by_mean(its)[: len(rivals) // 2]
        seeds, used = 2 * seeds, used + seeds
    return made, rivals[0] if rivals else None


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
