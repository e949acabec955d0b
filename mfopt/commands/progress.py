"""Progress on the screen: best so far, level, work spent and left, time to go."""

import math
import resource
from collections.abc import Mapping, Sequence
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from mfopt.campaign.driver import Progress as RunProgress
from mfopt.commands.forecast import Forecast, time_to_go
from mfopt.records.evaluation import Candidate, Insight
from mfopt.records.outcome import Outcome

BEFORE_END = ("check", "start", "search")  # purposes of what the budget pays for
PHASES = {
    "check": "checking",
    "start": "starts",
    "finalist": "finalists",
    "confirm": "confirming",
    "reference": "reference run",
}
WIDTH = 80  # [columns] that a line may take
BAR = 10  # [columns]
BESIDE = BAR + 10  # [columns] of bar, elapsed time and the gaps between them


class ProgressDisplay:
    """Shows how far a run has come: a bar on a terminal, a line per generation elsewhere.

    Args:
        console: where to draw.
        work: predicted work of one run, by level.
        full_run: that of the target level.
        unit: of the objective.
        after: work after the search, by level: finalists, confirmation and reference.
        budget: work that the search may spend; None if its plan of runs says it.
        workers: runs that are made at the same time.
        seconds_per_work: by level, as far as it was measured before the run.
    """

    def __init__(
        self,
        console: Console,
        *,
        work: Mapping[str, float],
        full_run: float,
        unit: str,
        after: Mapping[str, float],
        budget: float | None = None,
        workers: int = 1,
        seconds_per_work: Mapping[str, float] | None = None,
    ) -> None:
        self._console, self._work = console, work
        self._unit = "" if unit in ("-", "") else f" {unit}"
        self._after, self._budget, self._full_run = dict(after), budget, full_run
        self._target = next(name for name in work if work[name] == full_run)
        self._forecast = Forecast(
            work, full_run=full_run, workers=workers, seconds_per_work=seconds_per_work
        )
        self._spent = self._simulators_cpu_s = 0.0
        self._best: dict[str, float] = {}
        self._insight: Insight | None = None  # the latest; confirmation runs bring none
        self._phases: set[str] = set()
        columns = (TextColumn("{task.description}", markup=False), BarColumn(BAR),
                   TimeElapsedColumn())  # fmt: skip
        self._bar = Progress(*columns, console=console, refresh_per_second=1)
        self._task = self._bar.add_task("starting", total=None)

    def __enter__(self) -> "ProgressDisplay":
        if self._console.is_terminal:
            self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._bar.stop()

    def watch(self, progress: RunProgress) -> None:
        """Take notice of one more evaluation."""
        candidate, outcome = progress.evaluation.candidate, progress.evaluation.outcome
        work = self._work[candidate.level]
        self._spent += work
        if not progress.replayed:
            cpu_s = outcome.cpu_s + _settling_s(outcome)
            self._simulators_cpu_s += cpu_s
            self._forecast.learn(candidate.level, cpu_s)
        if candidate.purpose not in BEFORE_END:
            self._after[candidate.level] = self._after.get(candidate.level, 0.0) - work
        left = self._left(progress)
        whole = self._spent + sum(left.values())
        terminal = self._console.is_terminal
        words = fitted(
            [
                f"{_phase(candidate)} on {candidate.level}",
                self._best_known(progress),
                self._work_done(whole),
                time_to_go(self._forecast.seconds(left)),
            ],
            min(WIDTH, self._console.width) - BESIDE if terminal else WIDTH,
        )
        self._bar.update(self._task, description=words, completed=self._spent, total=whole)
        if _phase(candidate) not in self._phases and not terminal and not progress.replayed:
            self._console.print(words, soft_wrap=True, markup=False, emoji=False, highlight=False)
        self._phases.add(_phase(candidate))

    def _left(self, progress: RunProgress) -> dict[str, float]:
        """Work still to be done, by level."""
        left = {level: max(0.0, work) for level, work in self._after.items()}
        if progress.evaluation.candidate.purpose not in BEFORE_END:
            return left
        if self._budget is not None:
            search = [(self._target, max(0.0, self._budget - self._spent))]
        else:
            search = [(level, self._work[level] * runs) for level, runs in progress.runs_left]
        for level, work in search:
            left[level] = left.get(level, 0.0) + work
        return left

    def _work_done(self, whole: float) -> str:
        done, of = (_short(work / self._full_run) for work in (self._spent, whole))
        return f"work {done} of {of} full runs"

    def _best_known(self, progress: RunProgress) -> str:
        """The objective of the recommended design, or else the lowest of a run at this level."""
        level = progress.evaluation.candidate.level
        best = min(self._best.get(level, math.inf), progress.evaluation.objective)
        self._best[level] = best
        self._insight = progress.insight or self._insight
        if self._insight is not None:
            return _estimate(self._insight, self._unit)
        return f"best {best:.4g}{self._unit}" if math.isfinite(best) else "no run finished yet"

    def cpu(self) -> tuple[float, float]:
        """CPU time of mfopt itself, its workers and reports, and of the simulators [s].

        Complete once the workers have ended.
        """
        used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        total = sum(usage.ru_utime + usage.ru_stime for usage in used)
        return total - self._simulators_cpu_s, self._simulators_cpu_s


def _phase(candidate: Candidate) -> str:
    if candidate.purpose == "search":
        return f"generation {candidate.generation}"
    return PHASES[candidate.purpose.split()[0]]


def _settling_s(outcome: Outcome) -> float:
    """CPU time of filling the vessel [s], which the run itself does not count."""
    its = outcome.raw.get("settling_cpu_s")
    return float(its) if its is not None and its.ndim == 0 else 0.0


def _estimate(its: Insight, unit: str) -> str:
    """What the search believes of the recommended design; no interval where it is known."""
    if its.exact:
        return f"best {its.mean:.4g}{unit}"
    low, high = its.interval
    return f"best {its.mean:.4g} ({low:.3g} to {high:.3g}){unit}"


def _short(share: float) -> str:
    return f"{share:.1f}" if share < 1e4 else f"{share:.2g}"


def fitted(parts: Sequence[str], width: int) -> str:
    """The parts in one line of at most `width` columns.

    The first and the last are left out last; what is still too long is cut.
    """
    kept = [part for part in parts if part]
    while len(kept) > 2 and len("  ".join(kept)) > width:
        kept.pop(-2)
    if len(kept) > 1 and len("  ".join(kept)) > width:
        room = width - len(kept[-1]) - 2
        kept[0] = _cut(kept[0], room)
    return _cut("  ".join(kept), width)


def _cut(text: str, width: int) -> str:
    return text if len(text) <= width else f"{text[: max(0, width - 1)]}\u2026"
