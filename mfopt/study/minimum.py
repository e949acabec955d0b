"""What `minimize` found, and how it is said in a few lines."""

import textwrap
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mfopt.arrays import Array
from mfopt.errors import MfoptError
from mfopt.records.evaluation import Evaluation
from mfopt.records.problem import Problem
from mfopt.search.search import Search

if TYPE_CHECKING:
    from pandas import DataFrame

WIDTH = 100  # characters of a line
LONGEST_REASON = 500  # characters that an error says of why runs failed


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Minimum:
    """What `minimize` found: the recommended design, and every run made."""

    x: Array  # (d,)
    names: tuple[str, ...]  # of the variables, in the order of x
    f: float  # noise-free objective at x as estimated; as measured where no scatter is known
    interval: tuple[float, float] | None  # holds it with 95 %; None where nothing is known
    level: str  # that f is of
    best_run: Evaluation  # of the lowest value measured at that level
    why: str  # why the search ended
    evaluations: tuple[Evaluation, ...]
    stored: int = 0  # of the evaluations, taken from the directory

    def __repr__(self) -> str:
        best = self.best_run
        lines = [
            f"x: {self._named(self.x)}",
            f"f = {self.f:.6g} at level {self.level!r}, {self._doubt}",
            f"best run there: {best.objective:.6g} at {self._named(best.candidate.x)}",
            f"runs: {self._runs}",
            f"ended because {self.why}",
        ]
        return "\n".join(textwrap.fill(line, WIDTH, subsequent_indent="    ") for line in lines)

    def frame(self) -> "DataFrame":
        """Every run as a pandas frame: one row a run."""
        from pandas import DataFrame

        rows = [
            {
                **dict(zip(self.names, map(float, e.candidate.x), strict=True)),
                "level": e.candidate.level,
                "seed": e.candidate.seed,
                "f": e.objective,
                "status": e.outcome.status,
            }
            for e in self.evaluations
        ]
        return DataFrame(rows)

    def _named(self, x: Array) -> str:
        return ", ".join(f"{name} = {v:.6g}" for name, v in zip(self.names, x, strict=True))

    @property
    def _doubt(self) -> str:
        """What is known of the value, in words."""
        if self.interval is None:
            return "one run, its scatter unknown"
        low, high = self.interval
        if low == high:
            return "as measured: runs do not scatter"
        return f"estimated: between {low:.6g} and {high:.6g} with 95 %"

    @property
    def _runs(self) -> str:
        """Runs by level, failed and stored ones."""
        runs = Counter(e.candidate.level for e in self.evaluations)
        said = [f"{count} at {level!r}" for level, count in runs.items()]
        if failed := sum(not e.outcome.finished for e in self.evaluations):
            said.append(f"{failed} of all failed")
        if self.stored:
            said.append(f"{self.stored} of all were stored before")
        return ", ".join(said)


def minimum(
    problem: Problem,
    search: Search,
    best: Evaluation | None,
    evaluations: Sequence[Evaluation],
    *,
    target: str,
    stored: int,
) -> Minimum:
    """What a search has found that has ended.

    Args:
        problem: what was minimised over.
        search: the search.
        best: an evaluation of the recommended design, as `run_study` returns it.
        evaluations: all runs.
        target: name of the last level.
        stored: of the evaluations, taken from the directory.

    Raises:
        MfoptError: if no run at the target finished.
    """
    there = [e for e in evaluations if e.candidate.level == target and e.outcome.finished]
    if best is None or not there:
        raise MfoptError(why_nothing(evaluations, target))
    lowest = min(there, key=lambda e: e.objective)
    if best.candidate.level != target:  # its own run at the target failed
        best = lowest
    x, f, interval = best.candidate.x, best.objective, None
    insight = search.insight
    if insight is not None and insight.level == target and np.array_equal(insight.best, x):
        f = best.objective if insight.exact else insight.mean
        interval = (f, f) if insight.exact else insight.interval
    return Minimum(
        x, problem.names, f, interval, target, lowest, search.should_stop() or "",
        tuple(evaluations), stored,
    )  # fmt: skip


def why_nothing(evaluations: Sequence[Evaluation], target: str) -> str:
    """Why no run at the target finished, with the commonest reason."""
    there = [e for e in evaluations if e.candidate.level == target]
    counted: Sequence[Evaluation] = there
    said = f"no run at level {target!r} finished"
    if not there:
        said, counted = f"no run was made at level {target!r}", evaluations
    reasons = Counter(e.outcome.why for e in counted if not e.outcome.finished)
    if not reasons:
        return f"{said}; raise the budget"
    (why, count), *_ = reasons.most_common(1)
    where = "" if there else " at other levels"
    return f"{said}; {count} of {len(counted)}{where} failed with: {(why or '')[:LONGEST_REASON]}"
