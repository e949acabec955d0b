"""The course of a search over the work spent, if its generations gave insights."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby, pairwise

import numpy as np

from mfopt.arrays import Array, BoolArray, IntArray
from mfopt.campaign.store import RunDirectory
from mfopt.records.evaluation import Generation, Insight
from reports.rows import Row

MOST = 1e12  # [full runs] that a horizontal axis shows; as many as a cheapest run is of a full one
LEVEL_CHANGE = "level change to "

Place = tuple[Generation, float, float]  # a generation, and where it begins and ends on an axis


@dataclass(frozen=True, slots=True)
class Look:
    """One generation: the work at begin and end, and the insight."""

    generation: Generation
    began: float  # [full runs]
    ended: float
    insight: Insight | None  # None if it has not ended


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """The runs of a search and its generations, over the work spent."""

    levels: tuple[str, ...]  # coarse to fine
    spent: Array  # (n,) work up to and with each run [full runs]
    level: IntArray  # (n,) of each run
    failed: BoolArray  # (n,)
    looks: tuple[Look, ...]

    @property
    def places(self) -> list[Place]:
        """The generations over the work [full runs]."""
        return [(look.generation, look.began, look.ended) for look in self.looks]


def bands(places: Sequence[Place]) -> list[tuple[str, float, float]]:
    """Stretches at one level: its name, begin and end."""
    made = []
    for level, group in groupby(places, key=lambda place: place[0].level):
        its = list(group)
        made.append((level, its[0][1], its[-1][2]))
    return made


def course(run: RunDirectory, rows: Sequence[Row]) -> Course | None:
    """The course of a search; None without insights, or if the work cannot be drawn."""
    levels = run.header["levels"]
    search = [r for r in rows if r.purpose == "search"]
    if not (run.insights and search and levels[-1]["work"] > 0.0):
        return None
    names = tuple(level["name"] for level in levels)
    spent = np.cumsum([r.work for r in search]) / levels[-1]["work"]
    if not 1.0 / MOST < spent[-1] < MOST:
        return None
    return Course(
        names,
        spent,
        np.array([names.index(r.level) for r in search]),
        np.array([not r.finished for r in search]),
        tuple(_looks(run, [r.generation for r in search], spent)),
    )


def _looks(run: RunDirectory, generation_of: Sequence[int], spent: Array) -> list[Look]:
    taught = {i.generation: i for i in run.insights}
    last = {number: float(work) for number, work in zip(generation_of, spent, strict=True)}
    made, began = [], 0.0
    for g in run.generations:
        if g.number in last:
            made.append(Look(g, began, last[g.number], taught.get(g.number)))
            began = last[g.number]
    return made


def changes(generations: Sequence[Generation]) -> list[tuple[str, int, str]]:
    """Each change of level and restart with a reason: its mark, generation and the reason."""
    made: list[tuple[str, int, str]] = []
    restarts = 0
    for before, g in zip((None, *generations), generations, strict=False):
        if before is not None and g.level != before.level:
            reason = g.why.removeprefix(f"{LEVEL_CHANGE}{g.level}").lstrip(":, ")
            if reason:
                made.append((g.level, g.number, reason))
        elif before is not None and is_restart(before, g):
            restarts += 1
            made.append((f"R{restarts}", g.number, g.why))
    return made


def is_restart(before: Generation, its: Generation) -> bool:
    """Whether a generation restarts the search within the level of the one before."""
    return its.level == before.level and bool(its.why)


def restarts(places: Sequence[Place]) -> list[float]:
    """Where the search restarts within a level."""
    return [began for (one, *_), (its, began, _) in pairwise(places) if is_restart(one, its)]


def ranking(history: Course) -> Mapping[str, Array]:
    """Of each finished generation: work at its end, certainty of its ranking, candidates run."""
    known = [(look.ended, look.insight) for look in history.looks if look.insight is not None]
    return {
        "ended": np.array([ended for ended, _ in known]),
        "certainty": np.array([i.certainty for _, i in known]),
        "runs": np.array([i.runs for _, i in known]),
    }
