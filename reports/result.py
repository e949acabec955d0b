"""The result of a run: the best design, and its runs on fresh seeds."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mfopt.arrays import Array, frozen
from mfopt.records.evaluation import Insight
from reports.rows import Row
from reports.statistics import Comparison

SOLUTIONS = 6  # as many as fit a page's width beside bounds and baseline


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """The best design so far, and its confirmation."""

    found: Row  # the run of the search that found it, or its first confirmation
    confirmations: tuple[Row, ...]  # runs of it with fresh seeds
    baseline: tuple[Row, ...]  # runs of the baseline with fresh seeds
    objective: Comparison | None  # over the seeds that both were run with
    quantities: Mapping[str, Comparison]  # likewise, SI units; by name
    belief: Insight | None = None  # what the search last knew of this design, if it says so

    @property
    def x(self) -> Array:
        """The best design (d,), physical units."""
        return self.found.x

    @property
    def typical(self) -> Row:
        """Its run with the median objective over fresh seeds, or the one that found it."""
        ranked = sorted(self.confirmations, key=lambda r: r.value)
        return ranked[(len(ranked) - 1) // 2] if ranked else self.found


def result(
    rows: Sequence[Row], levels: Sequence[str], insights: Sequence[Insight] = ()
) -> Result | None:
    """The confirmed best design, else the one that the search recommends; None without one.

    A search that gives no insights recommends the design of the lowest value of one run at the
    finest level reached.

    Args:
        rows: the evaluations of a run.
        levels: names of its levels, coarse to fine.
        insights: what the generations taught, in order.
    """
    confirmed = [r for r in rows if r.purpose == "confirm best"]
    baseline = tuple(r for r in rows if r.purpose == "confirm baseline")
    if not confirmed:
        found = solutions(rows, levels, 1, insights)
        if not found:
            return None
        return Result(found[0], (), baseline, None, {}, _belief(found[0].x, insights, rows))
    own = tuple(r for r in confirmed if np.array_equal(r.x, confirmed[-1].x))
    search = (
        r
        for r in rows
        if r.purpose == "search" and r.level == own[0].level and np.array_equal(r.x, own[0].x)
    )
    return Result(
        next(search, own[0]),
        own,
        baseline,
        compare(own, baseline, lambda r: r.value),
        _quantities(own, baseline),
        _belief(own[0].x, insights, rows),
    )


def _belief(x: Array, insights: Sequence[Insight], rows: Sequence[Row]) -> Insight | None:
    """The latest insight that recommends the design `x` (d,), for a level that has run."""
    ran = {row.level for row in rows if row.finished}
    latest = reversed([i for i in insights if i.level in ran])
    return next((i for i in latest if np.array_equal(i.best, x)), None)


def _quantities(best: Sequence[Row], baseline: Sequence[Row]) -> dict[str, Comparison]:
    """What both designs give on the same seeds, beside the objective."""

    def of(name: str) -> Callable[[Row], float]:
        return lambda row: row.quantity(name) if row.finished else math.inf

    names = dict.fromkeys(name for row in (*best, *baseline) for name in row.quantities)
    found = {name: compare(best, baseline, of(name)) for name in names}
    return {name: comparison for name, comparison in found.items() if comparison is not None}


def compare(
    best: Sequence[Row], baseline: Sequence[Row], quantity: Callable[[Row], float]
) -> Comparison | None:
    """Pair the runs of two designs by seed; None without a pair or without finite values."""
    of_best = {r.seed: quantity(r) for r in best}
    of_baseline = {r.seed: quantity(r) for r in baseline}
    seeds = tuple(sorted(of_best.keys() & of_baseline.keys()))
    pairs = np.array([(of_best[s], of_baseline[s]) for s in seeds])
    if not seeds or np.isnan(pairs).any() or not np.isfinite(pairs).any():
        return None
    return Comparison(seeds, pairs[:, 0], pairs[:, 1])


def solutions(
    rows: Sequence[Row],
    levels: Sequence[str],
    count: int = SOLUTIONS,
    insights: Sequence[Insight] = (),
    chosen_x: Array | None = None,
) -> list[Row]:
    """The best different designs of search and finals: the best one, then the finest level first.

    Values of different levels do not compare, so a coarser level only fills up what the
    finer ones leave free. Within a level, the lowest objective comes first.

    Args:
        chosen_x: the best design (d,); the one that the search recommends if None.
    """
    fineness = {name: i for i, name in enumerate(levels)}
    finished = [r for r in rows if r.purpose in ("search", "finalist") and r.finished]
    ranked = sorted(finished, key=lambda r: (-fineness.get(r.level, -1), r.value))
    if chosen_x is None and insights:
        chosen_x = np.array(insights[-1].best)
    if chosen_x is not None:
        ranked.sort(key=lambda r: not np.array_equal(r.x, chosen_x))
    chosen: dict[bytes, Row] = {}
    for row in ranked:
        chosen.setdefault(row.x.tobytes(), row)
        if len(chosen) == count:
            break
    return list(chosen.values())


def best_at(rows: Sequence[Row], level: str, insights: Sequence[Insight] = ()) -> Array | None:
    """The best design (d,) at one level: last recommended there, else of the lowest value."""
    own = [i for i in insights if i.level == level]
    if insights:
        return frozen(own[-1].best) if own else None
    runs = [r for r in rows if r.purpose == "search" and r.level == level and r.finished]
    return min(runs, key=lambda r: r.value).x if runs else None


def typical_first(rows: Sequence[Row]) -> Row | None:
    """The run of the first generation whose objective is the median of that generation."""
    first = min((r.generation for r in rows if r.purpose == "search"), default=None)
    own = [r for r in rows if r.purpose == "search" and r.generation == first]
    return sorted(own, key=lambda r: r.value)[len(own) // 2] if own else None
