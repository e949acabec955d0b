"""A search in numbers: generations, work of the stages (table 3), failures."""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mfopt.records.evaluation import Generation
from reports.rows import Row
from reports.statistics import median
from reports.units import number

VALIDATION = "validation"  # runs of a generation that are not at its own level
PHASES = {
    "check": "check", "start": "starts", "search": "search", "finalist": "finalists",
    "confirm": "confirmation", "reference": "reference", "design": "design", "refine": "refinement",
    "predict": "prediction", "possible": "further experiments",
}  # fmt: skip
OF_SEARCH = ("check", "starts", "search", "finalists")  # what its budget may pay for
NUMBER = re.compile(r"\d+(\.\d*)?(e[+-]?\d+)?", re.IGNORECASE)
OWN_FOLDER = re.compile(r"""[^\s'"=:(]*/mfopt-[^\s'"/:)]+/?""")  # of one run, below TMPDIR
LONGEST_REASON = 600  # [characters]


@dataclass(frozen=True, slots=True)
class Step:
    """One generation with what its runs gave."""

    generation: Generation
    best: float  # of the finished runs, nan if there is none
    median: float
    quantities: Mapping[str, float]  # of the best run, SI units; by name
    runs: int
    failed: int


@dataclass(frozen=True, slots=True)
class Stage:
    """Runs of consecutive generations at one level, or confirmation runs."""

    level: str
    purpose: str
    generations: str  # such as 3-17, or empty
    population_size: int | None
    runs: int
    failed: int
    mean_cpu_s: float
    std_cpu_s: float
    cpu_s: float  # of all its runs
    work: float  # [full-run equivalents]


@dataclass(frozen=True, slots=True)
class Cost:
    """What one phase of a run cost."""

    phase: str  # in words
    runs: int
    failed: int
    work: float  # [full-run equivalents]; nan if the work of a full run is not known
    cpu_s: float


@dataclass(frozen=True, slots=True)
class Failure:
    """Failed runs with the same status and reason."""

    status: str
    why: str
    levels: str
    count: int


def steps(generations: Sequence[Generation], rows: Sequence[Row]) -> list[Step]:
    """The results of each generation, in order."""
    by_number: dict[int, list[Row]] = {}
    for row in rows:
        if row.purpose == "search":
            by_number.setdefault(row.generation, []).append(row)
    return [_step(g, by_number.get(g.number, [])) for g in generations]


def _step(generation: Generation, rows: Sequence[Row]) -> Step:
    finished = sorted((r for r in rows if r.finished), key=lambda r: r.value)
    if not finished:
        return Step(generation, math.nan, math.nan, {}, len(rows), len(rows))
    return Step(
        generation,
        finished[0].value,
        median([r.value for r in finished]),
        finished[0].quantities,
        len(rows),
        len(rows) - len(finished),
    )


def stages(
    generations: Sequence[Generation], rows: Sequence[Row], full_run_work: float | None
) -> list[Stage]:
    """Work and CPU time per stage, then of the confirmation runs, then of all.

    Args:
        generations: of the run, in order.
        rows: its evaluations.
        full_run_work: predicted work of one run of the baseline at the top level.
    """
    unit = full_run_work if full_run_work else math.nan
    search = [r for r in rows if r.purpose == "search"]
    made = []
    for group in _alike(generations):
        numbers, first = {g.number for g in group}, group[0]
        span = _span(first.number, group[-1].number)
        runs = [r for r in search if r.generation in numbers]
        own = [r for r in runs if r.level == first.level]
        named = "" if first.objective == "returned" else f" by {first.objective.replace('_', ' ')}"
        purpose = f"search{named}"
        made.append(_stage(first.level, purpose, span, first.population_size, own, unit))
        for level in dict.fromkeys(r.level for r in runs if r.level != first.level):
            looks = [r for r in runs if r.level == level]
            made.append(_stage(level, VALIDATION, span, None, looks, unit))
    known = {g.number for g in generations}
    others: dict[tuple[str, str], list[Row]] = {}
    for row in rows:
        if row.purpose != "search" or row.generation not in known:
            others.setdefault((row.level, row.purpose), []).append(row)
    for (level, purpose), runs in others.items():
        made.append(_stage(level, purpose, "", None, runs, unit))
    if len(made) > 1:
        made.append(_stage("all", "", "", None, rows, unit))
    return made


def _alike(generations: Sequence[Generation]) -> list[list[Generation]]:
    groups: list[list[Generation]] = []
    for g in generations:
        same = bool(groups) and _kind(groups[-1][-1]) == _kind(g)
        if same:
            groups[-1].append(g)
        else:
            groups.append([g])
    return groups


def _kind(g: Generation) -> tuple[str, int, str]:
    return g.level, g.population_size, g.objective


def _span(first: int, last: int) -> str:
    return str(first) if first == last else f"{first}\u2013{last}"


def _stage(
    level: str, purpose: str, span: str, size: int | None, rows: Sequence[Row], unit: float
) -> Stage:
    cpu = np.array([r.cpu_s for r in rows])
    return Stage(
        level, purpose, span, size, len(rows),
        sum(not r.finished for r in rows),
        float(cpu.mean()) if cpu.size else math.nan,
        float(cpu.std(ddof=1)) if cpu.size > 1 else math.nan,
        float(cpu.sum()),
        sum(r.work for r in rows) / unit,
    )  # fmt: skip


def costs(rows: Sequence[Row], full_run_work: float | None) -> list[Cost]:
    """What each phase cost, in the order in which they began.

    Args:
        rows: the evaluations of a run.
        full_run_work: predicted work of one run of the baseline at the top level.
    """
    unit = full_run_work if full_run_work else math.nan
    of: dict[str, list[Row]] = {}
    for row in rows:
        of.setdefault(PHASES[row.purpose.split()[0]], []).append(row)
    return [
        Cost(phase, len(runs), sum(not r.finished for r in runs),
             sum(r.work for r in runs) / unit, sum(r.cpu_s for r in runs))
        for phase, runs in of.items()
    ]  # fmt: skip


def cost_words(cost: Cost) -> str:
    """Work and CPU time of a phase."""
    return f"{number(cost.work, 3)} full runs, {hours(cost.cpu_s)}"


def hours(cpu_s: float) -> str:
    """CPU time in seconds, minutes or hours, whichever reads best."""
    if cpu_s < 60.0:
        return f"{number(cpu_s, 2)}\u202fCPU\u202fs"
    if cpu_s < 3600.0:
        return f"{number(cpu_s / 60.0, 2)}\u202fCPU\u202fmin"
    return f"{number(cpu_s / 3600.0, 3)}\u202fCPU\u202fh"


def failures(rows: Sequence[Row]) -> list[Failure]:
    """Failed runs by status and reason, most frequent first.

    Reasons that differ only in numbers count as one; the reason of the first run is shown.
    """
    alike: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for row in rows:
        if not row.finished:
            status = "no number" if row.status == "finished" else row.status.replace("_", " ")
            why = reason(row.why or "the run gave no finite objective")
            alike.setdefault((status, NUMBER.sub("#", why)), []).append((why, row.level))
    made = [
        Failure(status, runs[0][0], ", ".join(sorted({level for _, level in runs})), len(runs))
        for (status, _), runs in alike.items()
    ]
    return sorted(made, key=lambda failure: -failure.count)


def reason(why: str) -> str:
    """Why a run failed: without the name of the run's folder, and short enough for a table.

    Begin and end of a long log are kept.
    """
    text = OWN_FOLDER.sub("", why).strip()
    half = LONGEST_REASON // 2
    return text if len(text) <= LONGEST_REASON else f"{text[:half]} \u2026 {text[-half:]}"
