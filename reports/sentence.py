"""The result in one sentence, and the state of the run in words."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

from mfopt.records.evaluation import Insight
from mfopt.records.objective import Quantity
from reports.result import Result
from reports.rows import Row
from reports.statistics import Comparison, Interval
from reports.units import FAILED, Display, number


def objective_name(header: Mapping[str, Any]) -> str:
    """The study's objective in words."""
    name = str(header["objective"])
    return "objective value" if name == "returned" else f"objective ({name.replace('_', ' ')})"


def state(end: str | None, rows: Sequence[Row]) -> str | None:
    """The state of a run that has not ended; None for a run that has."""
    if end is not None:
        return None
    made = f"{len(rows)} run{'s' * (len(rows) != 1)} made so far" if rows else "no run made so far"
    return f"This run has not ended: it is still running or was interrupted ({made})."


def sentence(
    result: Result | None,
    rows: Sequence[Row],
    name: str,
    shown: Display,
    quantities: Sequence[Quantity] = (),
    *,
    ended: bool,
) -> str:
    """The result in one sentence.

    Args:
        result: best design and its confirmation.
        rows: all evaluations.
        name: of the objective, in words.
        shown: how its values are shown.
        quantities: what an engineer asks of a run beside it.
        ended: whether the run has ended.
    """
    if result is None:
        return "No run has finished yet, so there is no result." if rows else "Nothing has run yet."
    if result.objective is None or not math.isfinite(result.objective.median_best):
        return _unconfirmed(result, name, shown, quantities, so_far="" if ended else " so far")
    comparison = result.objective
    count = len(comparison.seeds)
    text = _no_better(comparison) + (
        f"The best design has a median {name} of {shown.full(comparison.median_best)} over "
        f"{count} fresh seed{'s' * (count != 1)}, {against(comparison, shown)}"
    )
    return text + _beside(result, quantities) + "."


def _no_better(comparison: Comparison) -> str:
    """Advice if no better design was found."""
    better = comparison.median_best < comparison.median_baseline
    return "" if better else "No better design was found: keep the baseline. "


def _beside(result: Result, quantities: Sequence[Quantity]) -> str:
    """The quantities of both designs, which the objective may hide; medians over the seeds."""
    said = []
    for q in quantities:
        comparison, shown = result.quantities.get(q.name), Display(*q.shown)
        if comparison is not None and math.isfinite(comparison.median_best):
            best = shown.full(comparison.median_best, 3)
            baseline = shown.full(comparison.median_baseline, 3)
            text = f"{q.name} {best}"
            if math.isfinite(comparison.median_baseline):
                text += " like the baseline" if baseline == best else f" instead of {baseline}"
            said.append(text)
    return f"; {', '.join(said)}" if said else ""


def _unconfirmed(
    result: Result, name: str, shown: Display, quantities: Sequence[Quantity], *, so_far: str
) -> str:
    row = result.found
    if result.belief is not None:
        return (
            f"The best design{so_far} has {_article(name)} {name} that the search estimates to be "
            f"{believed(result.belief, shown)} at level {result.belief.level}; fresh seeds have "
            "not confirmed it."
        )
    text = (
        f"The best design{so_far} has {_article(name)} {name} of {shown.full(row.value)} in one run"
    )
    for q in quantities:
        if math.isfinite(row.quantity(q.name)):
            text += f", {q.name} {Display(*q.shown).full(row.quantity(q.name), 3)}"
    return text + f" at level {row.level}; fresh seeds have not confirmed it."


def believed(belief: Insight, shown: Display) -> str:
    """The search's estimate of a design with the interval, or without if the estimate is exact."""
    if belief.exact:
        return shown.full(belief.mean)
    low, high = belief.interval
    return f"{shown.full(belief.mean)} ({shown.text(low)} to {shown.full(high)})"


def chosen(result: Result, *, method: str | None, insights: bool, finalists: int = 0) -> str:
    """How the best design was chosen.

    Args:
        result: the best design.
        method: of the search, as the study file names it; None if the run does not say.
        insights: whether the search says what it knows of its designs.
        finalists: designs that were told apart at the target level after the search.
    """
    text = _chosen_by_search(result, method=method, insights=insights)
    if finalists < 2:
        return text
    return (
        f"{text} Then the {finalists} most promising designs were run at the target level on other "
        "seeds. The design with the lowest mean is the best design."
    )


def _chosen_by_search(result: Result, *, method: str | None, insights: bool) -> str:
    if insights and method is None:
        text = "The design with the best estimate of the search was chosen."
    elif insights and method != "assisted":
        text = (
            "CMA-ES ran some candidates of a generation more than once. The design with the lowest "
            "mean of its runs at the finest level that it reached was chosen."
        )
    elif method != "assisted":
        return (
            "The search proposed the design with the lowest value of one run at the finest level "
            "that it reached. Such a value is too optimistic, because it is the lowest of many "
            "noisy values; runs on fresh seeds show the real value."
        )
    elif result.belief is not None and result.belief.exact:
        return (
            f"Runs at level {result.belief.level} do not scatter: a design that was run again on "
            "another seed had the same value. So the design of the best run was chosen."
        )
    else:
        text = (
            "A surrogate, a model of the objective, learns from the runs at all levels and "
            "estimates the objective of a design without noise. The design with the lowest "
            "estimate was chosen, not the design with the lowest single run. For candidates the "
            "estimate includes one standard deviation of doubt, because the lowest of many values "
            "is partly luck. For the centre of the distribution it includes only the doubt that "
            "one more run would remove."
        )
    if result.belief is None:
        return text
    return (
        f"{text} The estimate comes from generation {result.belief.generation} and is for level "
        f"{result.belief.level}; the true value lies in the interval with 95\u202f% probability."
    )


def _article(word: str) -> str:
    return "an" if word[:1].lower() in "aeiou" else "a"


def against(comparison: Comparison, shown: Display) -> str:
    """The best design's median compared with the baseline's, in words."""
    base, reduction = shown.full(comparison.median_baseline), comparison.reduction
    if reduction is None:
        return f"against {base} of the baseline"
    way = "below" if reduction >= 0.0 else "above"
    return f"{number(abs(reduction), 3)}\u202f% {way} the baseline's {base}"


def interval_text(interval: Interval | None, shown: Display, significant: int = 4) -> str:
    """An interval with its coverage in words."""
    if interval is None:
        return "one seed gives no interval"
    low, high = (shown.text(v, significant) for v in (interval.low, interval.high))
    return f"{low} to {shown.full(interval.high, significant) if high != FAILED else high}"


def at_bounds(share: float) -> str:
    """Whether a variable at this share of the range is at a bound; a wider bound may help then."""
    margin = 0.01  # of the range; a search rarely ends exactly on a bound
    if share < margin:
        return "at its lower bound"
    return "at its upper bound" if share > 1.0 - margin else ""
