"""The result in a few numbers: for the last lines of a run, and for scripts."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from rich.table import Table

from mfopt.store import RunDirectory
from reports.reference import repeated
from reports.result import Result, result
from reports.rows import Row, read_rows


def found_in(run: RunDirectory) -> tuple[tuple[Row, ...], Result | None]:
    """The evaluations of a run, and its best design so far."""
    rows = read_rows(run)
    return rows, result(rows, [level["name"] for level in run.header["levels"]], run.insights)


def answer(run: RunDirectory) -> dict[str, Any]:
    """How far a run has come and what it has found, in what JSON can hold."""
    with np.errstate(all="ignore"):
        rows, found = found_in(run)
    its: dict[str, Any] = {
        "study": run.header["study"],
        "ended": run.end,
        "evaluations": len(rows),
        "failed": sum(not row.finished for row in rows),
        "work": sum(row.work for row in rows),
        "cpu_s": sum(row.cpu_s for row in rows),
    }
    if found is not None:
        names = [variable["name"] for variable in run.header["variables"]]
        its["level"] = found.found.level
        its["objective"] = _finite(found.found.value)
        its["design"] = dict(zip(names, map(float, found.x), strict=True))
        if found.belief is not None:
            low, high = found.belief.interval
            its["believed"] = {
                "objective": found.belief.mean, "low": low, "high": high,
                "level": found.belief.level, "generation": found.belief.generation,
            }  # fmt: skip
        if found.objective is not None:
            its["confirmed_median"] = found.objective.median_best
            its["baseline_median"] = found.objective.median_baseline
            its["reduction_percent"] = found.objective.reduction
    if run.reference is not None:
        its["reference"] = _reference(run, rows)
    return {key: _finite(it) for key, it in its.items()}


def _reference(run: RunDirectory, rows: tuple[Row, ...]) -> dict[str, Any]:
    """What the reference engine gave, beside the target level with the same seed."""
    its = repeated(rows, run.reference)
    if its is None or run.reference is None:
        return {}
    if its.noted.why_not is not None:
        return {"left_out": its.noted.why_not}
    numbers = {}
    for design, pair in its.pairs.items():
        if pair is not None:
            numbers[design] = _finite(pair.there.value)
            numbers[f"{design}_at_target"] = None if pair.here is None else _finite(pair.here.value)
    return {"engine": f"{its.noted.engine} {its.noted.version}", **numbers}


def _finite(value: Any) -> Any:
    """The value with None in the place of what JSON cannot hold."""
    if isinstance(value, Mapping):
        return {key: _finite(its) for key, its in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


def as_table(its: Mapping[str, Any]) -> Table:
    """The answer in lines for a terminal."""
    table = Table(show_header=False, box=None)
    for key, value in its.items():
        if isinstance(value, dict):
            cells = (f"{name.replace('_', ' ')} {_short(it, 4)}" for name, it in value.items())
            shown = "  ".join(cells)
        else:
            shown = _short(value, 5)
        table.add_row(key.replace("_", " "), shown)
    return table


def _short(value: Any, digits: int) -> str:
    return f"{value:.{digits}g}" if isinstance(value, float) else str(value)
