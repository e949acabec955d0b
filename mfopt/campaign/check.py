"""Check, then spend: every level is started at the start design before a study spends its budget.

Cheap levels and the user's own programs run whole: those runs are kept, and the search learns from
them. A dear level that can be cut short runs only its first steps. Either tells that the level runs
at all, that its answer gives an objective, and how long a unit of its work takes.
"""

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np

from mfopt.arrays import Array
from mfopt.campaign.executor import Runner
from mfopt.campaign.memory import Memory
from mfopt.campaign.store import RunDirectory
from mfopt.errors import SimulationError
from mfopt.records.evaluation import Candidate, Evaluation
from mfopt.records.level import Ladder, Level
from mfopt.records.outcome import Outcome

# A level cannot run if its runs on all of these seeds fail. The search's own seeds begin so too.
SEEDS = (1, 2, 3)
CHEAP = 0.1  # of a full run: a level no dearer runs whole
# Shares of a run that are run of a dear one; their difference leaves out what a start costs.
SHORT, LONG = 0.003, 0.03

SECONDS = "check_seconds_per_work"  # name of the array that a trial adds

Judge = Callable[[Outcome], tuple[Outcome, float]]  # crashed if it gives no objective; its value
Recall = Callable[[Candidate], Evaluation | None]  # what the run directory holds


@runtime_checkable
class Probed(Protocol):
    """A level whose run can be cut short."""

    def probe(self, x: Array, *, seed: int, share: float) -> Outcome:
        """Run the first `share` of a run at `x` (d,); its work and CPU time are those of the part.

        A failed run is returned, not raised.
        """


@dataclass(frozen=True, slots=True)
class Trial:
    """A level as it is started to be checked. Implements `mfopt.records.level.Level`."""

    level: Level
    whole: bool

    @property
    def name(self) -> str:
        """Name of the level."""
        return self.level.name

    def work(self, x: Array) -> float:
        """Predicted work of a whole run."""
        return self.level.work(x)

    def evaluate(self, x: Array, *, seed: int) -> Outcome:
        """Run, whole or the first steps; the raw outcome says how long a unit of work takes."""
        if not self.whole and isinstance(self.level, Probed):
            return _slope(self.level, x, seed)
        began = time.monotonic()
        outcome = self.level.evaluate(x, seed=seed)
        # An engine's CPU time leaves out what is done once, such as loading its kernel.
        seconds = outcome.cpu_s if isinstance(self.level, Probed) else time.monotonic() - began
        return _timed(outcome, seconds, outcome.work or self.work(x))


@dataclass(frozen=True, slots=True, eq=False)
class Checked:
    """What starting every level gave."""

    evaluations: tuple[Evaluation, ...]  # whole runs, of purpose "check", from number 0 on
    seconds_per_work: Mapping[str, float]  # by level that was started


def whole_runs(ladder: Ladder, x: Array) -> list[Candidate]:
    """The runs at the design `x` (d,) that a study begins with, level by level."""
    full_run = ladder.top.work(x)
    whole = [
        level
        for level in ladder
        if not isinstance(level, Probed) or level.work(x) <= CHEAP * full_run
    ]
    return [Candidate(n, x, level.name, SEEDS[0], 0, "check") for n, level in enumerate(whole)]


def check_levels(
    ladder: Ladder,
    x: Array,
    runner: Runner,
    judge: Judge,
    *,
    reference: Level | None = None,
    recall: Recall = lambda candidate: None,
) -> Checked:
    """Start every level at the design `x` (d,).

    Args:
        ladder: the levels of the search.
        runner: makes the runs.
        judge: the objective.
        reference: a level beside the ladder, of which the first steps are run.
        recall: finds whole runs that were made before; those are not made again.

    Raises:
        SimulationError: if all runs of a level failed; the message ends with the last one's log.
    """
    asked = whole_runs(ladder, x)
    kept = {c.level: found for c in asked if (found := recall(c)) is not None}
    whole = {c.level for c in asked}
    trials = [Trial(level, level.name in whole) for level in ladder if level.name not in kept]
    trials += [] if reference is None else [Trial(reference, whole=False)]
    rates = {name: _rate(e.outcome.cpu_s, e.outcome.work) for name, e in kept.items()}
    try:
        for trial, evaluation, rate in _until_each_runs(trials, x, runner, judge):
            kept.setdefault(trial.name, evaluation)
            rates[trial.name] = rate
    except BaseException:
        runner.close()
        raise
    return Checked(tuple(replace(kept[c.level], candidate=c) for c in asked), rates)


def check_stored(
    run: RunDirectory,
    ladder: Ladder,
    x: Array,
    runner: Runner,
    judge: Judge,
    *,
    reference: Level | None = None,
) -> Checked:
    """`check_levels`, but for whole runs that are stored; nothing is started in a run that ended.

    Raises:
        SimulationError: if all runs of a level failed.
    """
    recall = Memory(run).recall
    if run.end is not None:
        found = [recall(candidate) for candidate in whole_runs(ladder, x)]
        if None not in found:
            return Checked(tuple(filter(None, found)), {})
    return check_levels(ladder, x, runner, judge, reference=reference, recall=recall)


def _until_each_runs(
    waiting: Sequence[Trial], x: Array, runner: Runner, judge: Judge
) -> Iterator[tuple[Trial, Evaluation, float]]:
    """Run each trial on one seed after the other, until it finishes on one.

    Raises:
        SimulationError: if one does not.
    """
    ended: dict[str, Outcome] = {}
    for seed in SEEDS:
        for trial, evaluation, rate in _tried(waiting, x, seed, runner, judge):
            ended[trial.name] = evaluation.outcome
            yield trial, evaluation, rate
        waiting = [trial for trial in waiting if not ended[trial.name].finished]
    if waiting:
        name = waiting[0].name
        raise SimulationError(
            f"level {name!r} cannot run: its first {len(SEEDS)} runs, at the start design, all "
            f"failed, the last one so:\n{ended[name].why}"
        )


def _tried(
    trials: Sequence[Trial], x: Array, seed: int, runner: Runner, judge: Judge
) -> Iterator[tuple[Trial, Evaluation, float]]:
    """Run each trial once; with each what it gave and the seconds that a unit of work took."""
    if not trials:
        return
    asked = [Candidate(n, x, trial.name, seed, 0, "check") for n, trial in enumerate(trials)]
    for candidate, timed in runner.run(Ladder(tuple(trials)), asked):
        trial = trials[candidate.index]
        outcome, rate = _untimed(timed)
        judged = judge(outcome) if trial.whole else (outcome, math.inf)
        yield trial, Evaluation(candidate, *judged), rate


def _slope(level: Probed, x: Array, seed: int) -> Outcome:
    """The first steps, with the time that a unit of work takes beyond the start."""
    short = level.probe(x, seed=seed, share=SHORT)
    if not short.finished:
        return short
    long = level.probe(x, seed=seed, share=LONG)
    seconds, work = long.cpu_s - short.cpu_s, long.work - short.work
    if seconds <= 0.0 or work <= 0.0:
        seconds, work = long.cpu_s, long.work
    return _timed(long, seconds, work)


def _timed(outcome: Outcome, seconds: float, work: float) -> Outcome:
    return replace(outcome, raw={**outcome.raw, SECONDS: np.asarray(_rate(seconds, work))})


def _rate(seconds: float, work: float) -> float:
    return seconds / work if work > 0.0 else 0.0


def _untimed(outcome: Outcome) -> tuple[Outcome, float]:
    """The outcome as the level gave it, and the seconds that a unit of its work took."""
    raw = dict(outcome.raw)
    rate = raw.pop(SECONDS, None)  # missing where a worker died
    return replace(outcome, raw=raw), 0.0 if rate is None else float(rate)
