"""The tables of a report, as text ready to be set."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mfopt.arrays import Array
from mfopt.records.objective import Quantity
from reports.campaign import Stage, hours
from reports.result import Result
from reports.rows import Row
from reports.sentence import at_bounds, interval_text, objective_name
from reports.statistics import Comparison, median_interval
from reports.units import MISSING, Display, design_display, number

PERCENT = Display(1.0, "%")


@dataclass(frozen=True, slots=True)
class VariableLine:
    """A variable with its bounds, and where baseline and best lie between them."""

    name: str
    unit: str
    lower: str
    upper: str
    baseline: str
    best: str
    baseline_share: float  # 0 at the lower, 1 at the upper bound
    best_share: float | None
    remark: str


def variable_displays(variables: Sequence[Mapping[str, Any]]) -> list[Display]:
    """How the values of each variable are shown."""
    return [design_display(v["unit"], v["lower"], v["upper"]) for v in variables]


def variables(header: Mapping[str, Any], best: Array | None) -> list[VariableLine]:
    """The design variables, one line each."""
    lines = []
    shown = variable_displays(header["variables"])
    for i, (v, d) in enumerate(zip(header["variables"], shown, strict=True)):
        width = v["upper"] - v["lower"]
        share = None if best is None else (float(best[i]) - v["lower"]) / width
        lines.append(
            VariableLine(
                v["name"], d.unit, d.text(v["lower"]), d.text(v["upper"]),
                d.text(header["baseline"][i]),
                MISSING if best is None else d.text(float(best[i])),
                (header["baseline"][i] - v["lower"]) / width, share,
                "" if share is None else at_bounds(share),
            )
        )  # fmt: skip
    return lines


def ladder(header: Mapping[str, Any]) -> list[list[str]]:
    """Name, engine, grains, spheres per grain, work of one run, and the same in full runs."""
    top = header["levels"][-1]["work"] if header["levels"] else None
    return [
        [
            level["name"], level["engine"] or MISSING, _whole(level["grains"]),
            _whole(level["spheres_per_grain"]), number(level["work"], 3),
            number(level["work"] / top, 3) if top else MISSING,
        ]
        for level in header["levels"]
    ]  # fmt: skip


def _whole(value: float | None) -> str:
    return MISSING if value is None or value != value else f"{value:.0f}"


def comparison_lines(
    result: Result, name: str, shown: Display, quantities: Sequence[Quantity]
) -> list[list[str]]:
    """Quantity, best, baseline and change, each with its interval, for what was confirmed."""
    lines = []
    if result.objective is not None:
        lines.append(_comparison(f"{name} [{shown.unit}]", result.objective, shown))
    for q in quantities:
        if q.name in result.quantities:
            label, unit = label_of(q), Display(*q.shown)
            lines.append(_comparison(label, result.quantities[q.name], unit))
    return lines


def _comparison(label: str, comparison: Comparison, shown: Display) -> list[str]:
    plain = Display(shown.factor, MISSING)
    best, baseline = (
        interval_text(median_interval(values), plain)
        for values in (comparison.best, comparison.baseline)
    )
    return [
        label,
        shown.text(comparison.median_best), best,
        shown.text(comparison.median_baseline), baseline,
        MISSING if comparison.reduction is None else change_text(comparison.reduction),
        MISSING if (its := comparison.reduction_interval) is None
        else f"{change_text(its.high, unit=False)} to {change_text(its.low)}",
    ]  # fmt: skip


def change_text(reduction: float, *, unit: bool = True) -> str:
    """A reduction [%] as a change, with a sign: less than before is negative."""
    change = 0.0 - reduction
    text = PERCENT.full(change, 3) if unit else PERCENT.text(change, 3)
    return f"+{text}" if change > 0.0 else text


def belief_lines(result: Result, shown: Display) -> list[list[str]]:
    """What the search believed of the best design, and what fresh seeds say: level, interval."""
    lines = []
    if (belief := result.belief) is not None:
        low, high = belief.interval
        interval = f"{shown.text(low)} to {shown.text(high)}"
        interval = "runs do not scatter" if belief.exact else interval
        lines.append(["estimated by the search", belief.level, shown.text(belief.mean), interval])
    if lines and (seen := result.objective) is not None:
        plain = Display(shown.factor, MISSING)
        interval = interval_text(median_interval(seen.best), plain)
        level = result.confirmations[0].level
        lines.append(["median over fresh seeds", level, shown.text(seen.median_best), interval])
    return lines


def label_of(quantity: Quantity) -> str:
    """Name and unit of a quantity at the head of a column."""
    return f"{quantity.name} [{quantity.shown[1]}]"


def confirmations(
    result: Result, shown: Display, quantities: Sequence[Quantity]
) -> list[list[str]]:
    """Seed by seed the objective of best and baseline, and their quantities."""
    best = {r.seed: r for r in result.confirmations}
    baseline = {r.seed: r for r in result.baseline}
    return [
        [
            str(seed),
            *_run(best.get(seed), shown, quantities),
            *_run(baseline.get(seed), shown, quantities),
        ]
        for seed in sorted(best.keys() | baseline.keys())
    ]


def _run(row: Row | None, shown: Display, quantities: Sequence[Quantity]) -> list[str]:
    if row is None:
        return [MISSING] * (1 + len(quantities))
    return [shown.text(row.value), *(text_of(row, q) for q in quantities)]


def text_of(row: Row, quantity: Quantity) -> str:
    """A quantity of a run, without its unit."""
    return Display(*quantity.shown).text(row.quantity(quantity.name), 3)


def best_solutions(
    header: Mapping[str, Any],
    rows: Sequence[Row],
    shown: Display,
    quantities: Sequence[Quantity],
) -> list[tuple[str, str, list[str]]]:
    """Name, unit and one value per solution: its results first, then its variables."""
    lines = [
        (objective_name(header), shown.unit, [shown.text(r.value) for r in rows]),
        *((q.name, q.shown[1], [text_of(r, q) for r in rows]) for q in quantities),
        ("level", "", [r.level for r in rows]),
        ("generation", "", [str(r.generation) for r in rows]),
    ]  # fmt: skip
    lines = [line for line in lines if any(value != MISSING for value in line[2])]
    displays = variable_displays(header["variables"])
    for i, (v, d) in enumerate(zip(header["variables"], displays, strict=True)):
        lines.append((v["name"], d.unit, [d.text(float(r.x[i])) for r in rows]))
    return lines


def work(stages: Sequence[Stage]) -> list[list[str]]:
    """The paper's table 3: what each stage of the search cost."""
    return [
        [
            s.level, s.purpose, s.generations or MISSING, _whole(s.population_size), str(s.runs),
            str(s.failed), _mean_and_spread(s), hours(s.cpu_s), number(s.work, 3),
        ]
        for s in stages
    ]  # fmt: skip


def _mean_and_spread(stage: Stage) -> str:
    if np.isnan(stage.std_cpu_s):
        return number(stage.mean_cpu_s, 3)
    return f"{number(stage.mean_cpu_s, 3)} ({number(stage.std_cpu_s, 2)})"
