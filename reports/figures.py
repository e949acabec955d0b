"""The figures of a report page with their words, made once for HTML and PDF.

`charts.py`, `course_chart.py` and `pictures.py` draw. A function here chooses the data of a figure
and says what it shows; its line in `PLACES` puts it on the page.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mfopt.arrays import AnyArray, Array
from mfopt.records.view import DesignView
from reports import charts, course_chart, pictures
from reports.course import changes
from reports.facts import Facts
from reports.rows import Row


@dataclass(frozen=True, slots=True)
class Figure:
    """A drawing and its words."""

    svg: str
    alt: str  # what a reader who cannot see it is told
    caption: str
    heading: str = ""  # of its section, where it has one of its own
    kind: str = "chart"  # "natural": never wider than it was made for


@dataclass(frozen=True, slots=True)
class Shown:
    """What figures show: a run, and the views of best design and baseline where there are any."""

    facts: Facts
    best: DesignView | None
    baseline: DesignView | None


def figures(shown: Shown) -> dict[str, list[Figure]]:
    """The figures that this run has, by their place on the page."""
    return {
        place: [made for make in its if (made := make(shown)) is not None]
        for place, its in PLACES.items()
    }


def passages(shown: Shown) -> Figure | None:
    """When grains pass."""
    result, best = shown.facts.result, shown.best
    if result is None:
        return None
    times = _passage_times(shown.facts, result.confirmations or (result.found,))
    if not times:
        return None
    clock = "the start of the run" if best is None else best.clock
    where = "the outlet" if best is None else best.counted_at
    return Figure(
        charts.passages(times, _passage_times(shown.facts, result.baseline), clock),
        "Two aligned panels over time: share of grains passed, and grains per second, best design "
        "against baseline.",
        f"Grains that pass {where}, all runs together. Above: share of the grains that have passed "
        "(grains left behind do not count). Below: grains per second.",
    )


def motion(shown: Shown) -> Figure | None:
    """How the moving part moves."""
    best = shown.best
    if best is None or not len(best.motion_times):
        return None
    points = " Circles are the points between which the motion is a straight line."
    return Figure(
        charts.motion(best, shown.baseline),
        f"Two aligned panels over time: position and velocity of the {best.mover}, best design "
        "against baseline.",
        f"Position and velocity of the {best.mover} over one cycle."
        + points * bool(best.motion_points),
        f"Motion of the {best.mover}",
    )


def course(shown: Shown) -> Figure | None:
    """The search over the work that it spent, where the search chose the levels."""
    facts = shown.facts
    if facts.course is None:
        return None
    confirmed = None if facts.result is None else facts.result.objective
    predicted = ", because the other candidates could be predicted"
    return Figure(
        course_chart.course(facts.course, facts.shown, facts.name, confirmed),
        "Four aligned panels over the work spent: estimated objective of the recommended design, "
        "level of each run, certainty of each ranking, runs per generation.",
        "The search over the work that it spent. From above: the estimated objective of the "
        "recommended design; the level of each run, including validations at the next level; the "
        "certainty of each generation's ranking; and the number of runs of each generation"
        + predicted * assisted(facts)
        + ". Shaded areas are the levels; values of different levels do not compare exactly."
        + _restarts(facts),
    )


def generations(shown: Shown) -> Figure | None:
    """Best and median of each generation, where the study planned the levels."""
    facts = shown.facts
    if facts.course is not None or not any(np.isfinite(s.best) for s in facts.steps):
        return None
    bound = shown.best.bound_any if shown.best else None  # it holds for every design
    return Figure(
        charts.progress(facts.steps, facts.shown, facts.name, facts.beside, bound),
        "Best and median objective of each generation, with changes of level, restarts and failed "
        "runs marked.",
        "Best and median finished run of each generation. Shaded areas are the levels; values of "
        "different levels do not compare exactly. Crosses show the number of failed runs."
        + _restarts(facts),
    )


def snapshots(shown: Shown) -> Figure | None:
    """The grains in the best design."""
    result = shown.facts.result
    if result is None or shown.best is None:
        return None
    made = pictures.snapshots(_raw(shown.facts, result.typical), shown.best)
    if made is None:
        return None
    seeds = " over the fresh seeds" * bool(result.confirmations)
    return Figure(
        made,
        "Four pictures of the grains in the opened machine at rising times, coloured by their "
        "speed.",
        "Grains of one run of the best design, coloured by speed, seen from the front; black lines "
        f"are the walls cut at y = 0. Shown is the run with the median objective{seeds}.",
        "The best design at work",
        "natural",
    )


# Where they stand: in the section of the result, after it, in the section of the search, after it.
# Those after a section need a heading.
PLACES: Mapping[str, tuple[Callable[[Shown], Figure | None], ...]] = {
    "result": (passages,),
    "after_result": (motion,),
    "search": (course, generations),
    "after_search": (snapshots,),
}


def assisted(facts: Facts) -> bool:
    """Whether a surrogate chose the designs that were run."""
    return facts.header.get("method") == "assisted"


def _restarts(facts: Facts) -> str:
    levels = [level["name"] for level in facts.header["levels"]]
    marked = any(mark not in levels for mark, _, _ in changes(facts.run.generations))
    return " R marks a restart." * marked


def _raw(facts: Facts, row: Row) -> Mapping[str, AnyArray]:
    evaluation = facts.run.evaluation(row.index)
    return {} if evaluation is None else evaluation.outcome.raw


def _passage_times(facts: Facts, rows: Sequence[Row]) -> list[Array]:
    found = [_raw(facts, r).get("passage_times", np.empty(0)) for r in rows if r.finished]
    return [times for times in found if times.size and np.isfinite(charts.drawable(times)).all()]
