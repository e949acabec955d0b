"""The result in a few numbers, for the screen and for scripts."""

import math
import textwrap
from collections.abc import Mapping
from typing import Any

import numpy as np

from mfopt.campaign.store import RunDirectory
from reports import campaign
from reports.facts import Facts, gather
from reports.needs import Need, needs
from reports.reference import repeated
from reports.result import Result, result
from reports.rows import Row, read_rows
from reports.sentence import against, believed, interval_text, state
from reports.statistics import median_interval
from reports.tables import variable_displays

WIDTH = 80  # [columns] of the smallest terminal
LABEL = 22  # [columns] of the words before the colon
ON_SCREEN = str.maketrans({"\u202f": " ", "\u2212": "-", "\u2013": "-"})


def found_in(run: RunDirectory) -> tuple[tuple[Row, ...], Result | None]:
    """The evaluations of a run, and its best design so far."""
    rows = read_rows(run)
    return rows, result(rows, [level["name"] for level in run.header["levels"]], run.insights)


def answer(run: RunDirectory) -> dict[str, Any]:
    """State and result of a run as JSON values; SI units."""
    with np.errstate(all="ignore"):
        facts = gather(run)
        found, header = facts.result, facts.header
        said: dict[str, Any] = {
            "study": header["study"],
            "ended": facts.run.end,
            "evaluations": len(facts.rows),
            "failed": sum(not row.finished for row in facts.rows),
            "cost": {cost.phase: _cost(cost) for cost in facts.costs},
        }
        if found is not None:
            said |= {
                "level": found.found.level,
                "objective": found.found.value,
                "objective_unit": header["objective_unit"],
                "design": dict(zip(_names(facts), map(float, found.x), strict=True)),
                **_believed(found),
                **_confirmed(found),
            }
        if lines := needs(facts.rows, found, facts.quantities):
            said["needs"] = {line.name: _need(line) for line in lines}
        if facts.run.reference is not None:
            said["reference"] = _reference(facts)
        return {key: _finite(value) for key, value in said.items()}


def _names(facts: Facts) -> list[str]:
    return [variable["name"] for variable in facts.header["variables"]]


def _cost(cost: campaign.Cost) -> dict[str, Any]:
    return {"full_runs": cost.work, "cpu_s": cost.cpu_s, "runs": cost.runs, "failed": cost.failed}


def _believed(found: Result) -> dict[str, Any]:
    if (belief := found.belief) is None:
        return {}
    low, high = belief.interval
    return {"believed": {
        "objective": belief.mean, "low": low, "high": high, "level": belief.level,
        "generation": belief.generation,
    }}  # fmt: skip


def _confirmed(found: Result) -> dict[str, Any]:
    if (comparison := found.objective) is None:
        return {}
    return {
        "confirmed_median": comparison.median_best,
        "baseline_median": comparison.median_baseline,
        "reduction_percent": comparison.reduction,
    }


def _need(line: Need) -> dict[str, Any]:
    of = {
        design: {
            "median": spread.median,
            "low": spread.low,
            "high": spread.high,
            "runs": spread.runs,
        }
        for design, spread in line.spreads.items()
    }
    return {"unit": line.unit, "limit": line.limit, "wanted": line.wanted, **of}


def _reference(facts: Facts) -> dict[str, Any]:
    """What the reference engine gave, beside the target level with the same seed."""
    reference = repeated(facts.rows, facts.run.reference)
    assert reference is not None
    if reference.noted.why_not is not None:
        return {"skipped": reference.noted.why_not}
    numbers: dict[str, float | None] = {}
    for design, pair in reference.pairs.items():
        if pair is not None:
            numbers[design] = pair.there.value
            numbers[f"{design}_at_target"] = None if pair.here is None else pair.here.value
    return {"engine": f"{reference.noted.engine} {reference.noted.version}", **numbers}


def _finite(value: Any) -> Any:
    """The value, with None instead of numbers that JSON cannot hold."""
    if isinstance(value, Mapping):
        return {key: _finite(part) for key, part in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


def as_text(run: RunDirectory, width: int = WIDTH) -> str:
    """State and result of a run, in lines of at most `width` columns."""
    with np.errstate(all="ignore"):
        facts = gather(run)
        lines = [
            ("study", str(facts.header["study"])),
            *_state_lines(facts),
            *_result_lines(facts),
            *_reference_lines(facts),
            *_cost_lines(facts),
        ]
    room = " " * LABEL
    text = "\n".join(
        line
        for label, words in lines
        for line in textwrap.wrap(
            words, width, initial_indent=f"{label:<{LABEL - 1}} ", subsequent_indent=room
        )
        or [label]
    )
    return text.translate(ON_SCREEN)


def _state_lines(facts: Facts) -> list[tuple[str, str]]:
    said = state(facts.run.end, facts.rows)
    return [("ended", str(facts.run.end)) if said is None else ("state", said)]


def _result_lines(facts: Facts) -> list[tuple[str, str]]:
    found = facts.result
    if found is None:
        return []
    lines = []
    if found.objective is not None:
        comparison = found.objective
        within = median_interval(comparison.best)
        scatter = "" if within is None else f" ({interval_text(within, facts.shown)})"
        median = facts.shown.full(comparison.median_best)
        words = f"{median}{scatter}, {against(comparison, facts.shown)}"
        lines.append((facts.name, words))
    elif found.belief is None:
        words = f"{facts.shown.full(found.found.value)} in one run at level {found.found.level}"
        lines.append((facts.name, words))
    lines += [(line.label, line.sentence()) for line in needs(facts.rows, found, facts.quantities)]
    if found.belief is not None:
        words = f"{believed(found.belief, facts.shown)} at level {found.belief.level}"
        lines.append(("estimate of the search", words))
    shown = variable_displays(facts.header["variables"])
    design = zip(_names(facts), shown, found.x, strict=True)
    lines.append(("best design", ", ".join(f"{n}\u202f{d.full(float(v))}" for n, d, v in design)))
    return lines


def _reference_lines(facts: Facts) -> list[tuple[str, str]]:
    reference = repeated(facts.rows, facts.run.reference)
    if reference is None:
        return []
    if reference.noted.why_not is not None:
        return [("reference", f"skipped: {reference.noted.why_not}")]
    said = [
        f"{design} {facts.shown.full(pair.there.value)}"
        for design, pair in reference.pairs.items()
        if pair is not None
    ]
    where = f"{reference.noted.engine} {reference.noted.version}"
    return [("reference", f"on {where}: {', '.join(said)}" if said else f"{where}: not run yet")]


def _cost_lines(facts: Facts) -> list[tuple[str, str]]:
    lines = []
    for cost in facts.costs:
        words = f"{campaign.cost_words(cost)} in {cost.runs} run{'s' * (cost.runs != 1)}"
        lines.append((f"cost: {cost.phase}", words))
    if failed := campaign.failures(facts.rows):
        most_frequent, why = failed[0], (failed[0].why.splitlines() or [""])[0]
        most = f"{most_frequent.count} {most_frequent.status}: {why}"
        lines.append(("failed runs", f"{sum(f.count for f in failed)}, of which {most}"))
    return lines
