"""Progress on the screen: best so far, level, work spent and left, time to go."""

import math
import resource
import time
from collections.abc import Mapping
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from mfopt.evaluation import Candidate
from mfopt.run import Progress as RunProgress

PHASES = {
    "check": "checking",
    "start": "starts",
    "finalist": "finalists",
    "confirm": "confirming",
    "reference": "reference run",
}


class ProgressDisplay:
    """Shows how far a run has come: a bar on a terminal, a line per generation elsewhere.

    Args:
        console: where to draw.
        work: predicted work of one run, by level.
        full_run: that of the target level.
        unit: of the objective.
        confirm_work: work of the confirmation after the search.
        budget: work that the search may spend; None if its plan of runs says it.
    """

    def __init__(
        self,
        console: Console,
        *,
        work: Mapping[str, float],
        full_run: float,
        unit: str,
        confirm_work: float,
        budget: float | None = None,
    ) -> None:
        self._console, self._work = console, work
        self._unit = "" if unit == "-" else f" {unit}"
        self._confirm_work, self._budget = confirm_work, budget
        self._full_run = full_run
        self._spent = self._measured = self._simulators_cpu_s = 0.0
        self._began = time.monotonic()
        self._best: dict[str, float] = {}
        self._phases: set[str] = set()
        columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
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
            self._measured += work
            self._simulators_cpu_s += outcome.cpu_s + float(outcome.raw.get("settling_cpu_s", 0.0))
        if candidate.purpose not in ("check", "start", "search"):
            self._confirm_work -= work
        left = self._left(progress)
        words = (
            f"{_phase(candidate)} on {candidate.level}  {self._best_known(progress)}  "
            f"work {self._spent / self._full_run:.1f} of "
            f"{(self._spent + left) / self._full_run:.1f} full runs  {self._to_go(left)}"
        )
        self._bar.update(
            self._task, description=words, completed=self._spent, total=self._spent + left
        )
        new = _phase(candidate) not in self._phases
        if new and not self._console.is_terminal and not progress.replayed:
            self._console.print(words, soft_wrap=True)
        self._phases.add(_phase(candidate))

    def _left(self, progress: RunProgress) -> float:
        """Work still to be done."""
        if progress.evaluation.candidate.purpose not in ("check", "start", "search"):
            return self._confirm_work
        if self._budget is not None:
            return self._confirm_work + max(0.0, self._budget - self._spent)
        return self._confirm_work + sum(self._work[name] * n for name, n in progress.runs_left)

    def _best_known(self, progress: RunProgress) -> str:
        """The objective of the recommended design, or else the lowest of a run at this level."""
        level = progress.evaluation.candidate.level
        best = min(self._best.get(level, math.inf), progress.evaluation.objective)
        self._best[level] = best
        its = progress.insight
        if its is None:
            return f"best {best:.4g}{self._unit}"
        low, high = its.interval
        half = (high - low) / 2.0
        return f"best {its.mean:.4g} \u00b1 {half:.2g}{self._unit} (estimated for {its.level})"

    def cpu(self) -> tuple[float, float]:
        """CPU time of mfopt itself, its workers and reports, and of the simulators [s].

        Complete once the workers have ended.
        """
        used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
        total = sum(usage.ru_utime + usage.ru_stime for usage in used)
        return total - self._simulators_cpu_s, self._simulators_cpu_s

    def _to_go(self, left: float) -> str:
        if self._measured <= 0.0:
            return ""
        seconds = (time.monotonic() - self._began) * left / self._measured
        minutes, rest = divmod(round(seconds), 60)
        return f"about {minutes} min {rest:02d} s to go"


def _phase(candidate: Candidate) -> str:
    if candidate.purpose == "search":
        return f"generation {candidate.generation}"
    return PHASES[candidate.purpose.split()[0]]
