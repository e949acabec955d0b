"""The page of a report: everything its template sets, computed once for both forms."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mfopt.arrays import AnyArray, Array
from mfopt.store import RunDirectory
from reports import campaign, charts, course_chart, pictures, reference, tables, viewer
from reports.course import Course, changes, course
from reports.design import Describe, DesignView
from reports.plain import plain, readable_run
from reports.result import Result, best_at, result, solutions, typical_first
from reports.rows import Row, read_rows
from reports.sentence import chosen, objective_name, sentence, state
from reports.units import Display, display, number

ORIGIN = ("study", "mfopt_version", "platform", "created", "workers", "seed")  # of the header
DESIGNS = 6  # shapes shown at most: two rows of a page


@dataclass(frozen=True, slots=True, eq=False)
class Facts:
    """What the run directory says, reduced and evaluated."""

    run: RunDirectory
    rows: tuple[Row, ...]
    result: Result | None
    steps: list[campaign.Step]
    course: Course | None  # of a search that says what its generations taught
    stages: list[campaign.Stage]
    name: str  # of the objective, in words
    shown: Display  # how its values are shown

    @property
    def header(self) -> Mapping[str, Any]:
        """The run's header."""
        return self.run.header


def gather(run: RunDirectory) -> Facts:
    """Read a run directory once and evaluate it."""
    run = readable_run(run)
    rows, levels = read_rows(run), run.header["levels"]
    unit = str(run.header.get("objective_unit", "-"))
    top_work = levels[-1]["work"] if levels else None
    return Facts(
        run, rows,
        result(rows, [level["name"] for level in levels], run.insights),
        campaign.steps(run.generations, rows),
        course(run, rows),
        campaign.stages(run.generations, rows, top_work),
        objective_name(run.header),
        display(unit, [r.value for r in rows]),
    )  # fmt: skip


def context(run: RunDirectory, describe: Describe) -> dict[str, Any]:
    """Everything that the templates name: text, numbers, SVG drawings, PNG pictures."""
    facts = gather(run)
    run, its = facts.run, facts.result
    best = None if its is None else describe(its.x)
    baseline = describe(np.asarray(facts.header["baseline"], dtype=float))
    views = designs(facts, describe)
    shapes = pictures.shapes(views)
    return {
        "header": {name: facts.header[name] for name in ORIGIN},
        "versions": _versions(run),
        "study": _study(run),
        "end": run.end,
        "state": state(run.end, facts.rows),
        "sentence": sentence(its, facts.rows, facts.name, facts.shown, ended=run.end is not None),
        "name": facts.name,
        "unit": facts.shown.unit,
        "result": its and {"confirmed": bool(its.confirmations)},
        "assisted": _assisted(facts),
        "has_course": facts.course is not None,
        "chosen": its
        and chosen(its, method=facts.header.get("method"), insights=bool(run.insights)),
        "best": best and _shown(best),
        "cards": cards(facts, best),
        "designs": [(v.label, picture) for v, picture in zip(views, shapes, strict=True)],
        "scene": viewer.scene(views) if views else None,
        **_tables(facts),
        **_figures(facts, best, baseline),
    }


def _assisted(facts: Facts) -> bool:
    """Whether a surrogate chose the designs that were run."""
    return facts.header.get("method") == "assisted"


def _shown(best: DesignView) -> dict[str, Any]:
    bounds = {"bound_ms": best.bound_s, "bound_any_ms": best.bound_any_s}
    return {
        "notes": list(best.notes),
        "has_points": bool(best.motion_points),
        **{name: None if s is None else f"{1e3 * s:.0f}" for name, s in bounds.items()},
    }


def _versions(run: RunDirectory) -> dict[str, str]:
    versions = dict(run.header.get("versions") or {})
    if run.reference is not None and run.reference.engine:
        versions[run.reference.engine] = run.reference.version
    return versions


def _study(run: RunDirectory) -> str:
    try:
        return plain(run.study_file.read_text(encoding="utf-8", errors="replace"))
    except OSError:  # it is shown, and read for nothing else
        return ""


def _tables(facts: Facts) -> dict[str, Any]:
    its, header = facts.result, facts.header
    levels = [level["name"] for level in header["levels"]]
    best = solutions(facts.rows, levels, insights=facts.run.insights)
    dosing = any(np.isfinite(r.filling_time) for r in facts.rows)
    coverage = None
    if its is not None and its.objective is not None:
        interval = its.objective.reduction_interval
        coverage = None if interval is None else f"{100 * interval.coverage:.1f}"
    return {
        "variables": tables.variables(header, None if its is None else its.x),
        "ladder": tables.ladder(header),
        "comparison": tables.comparison_lines(its, facts.name, facts.shown) if its else [],
        "coverage": coverage,
        "confirmations": tables.confirmations(its, facts.shown, dosing=dosing) if its else [],
        "reference": _reference(facts),
        "solutions": tables.best_solutions(header, best, facts.shown) if best else [],
        "work": tables.work(facts.stages),
        "failures": campaign.failures(facts.rows),
        "belief": tables.belief_lines(its, facts.shown) if its else [],
        "changes": (its_changes := changes(facts.run.generations)),
        "has_restarts": any(mark not in levels for mark, _, _ in its_changes),
        "seeds": sorted({r.seed for r in facts.rows if r.purpose == "search"}),
        "dosing": dosing,
        "fresh_seeds": sorted({r.seed for r in facts.rows if r.purpose != "search"}),
    }


def _reference(facts: Facts) -> dict[str, Any] | None:
    """The runs of best and baseline on another engine; None if the study asks for none."""
    its = reference.repeated(facts.rows, facts.run.reference)
    if its is None:
        return None
    top = facts.header["levels"][-1]
    return {
        "words": reference.words(its, top["engine"], facts.shown),
        "columns": [its.noted.engine, top["engine"], "ratio"],
        "lines": reference.lines(its, facts.name, facts.shown) if any(its.pairs.values()) else [],
    }


def _figures(
    facts: Facts, best: DesignView | None, baseline: DesignView | None
) -> dict[str, str | None]:
    made: dict[str, str | None] = dict.fromkeys(("progress", "motion", "passages", "snapshots"))
    if facts.course is not None:
        confirmed = None if facts.result is None else facts.result.objective
        made["progress"] = course_chart.course(facts.course, facts.shown, facts.name, confirmed)
    elif any(np.isfinite(s.best) for s in facts.steps):
        bound = best.bound_any_s if best else None  # it holds for every design
        made["progress"] = charts.progress(facts.steps, facts.shown, facts.name, bound)
    if best is not None and len(best.motion_times):
        made["motion"] = charts.motion(best, baseline)
    if facts.result is not None:
        times = _passage_times(facts, facts.result.confirmations or (facts.result.found,))
        if times:
            made["passages"] = charts.passages(times, _passage_times(facts, facts.result.baseline))
        if best is not None:
            made["snapshots"] = pictures.snapshots(_raw(facts, facts.result.typical), best)
    return made


def _raw(facts: Facts, row: Row) -> Mapping[str, AnyArray]:
    evaluation = facts.run.evaluation(row.index)
    return {} if evaluation is None else evaluation.outcome.raw


def _passage_times(facts: Facts, rows: Sequence[Row]) -> list[Array]:
    found = [_raw(facts, r).get("passage_times", np.empty(0)) for r in rows if r.finished]
    return [times for times in found if times.size and np.isfinite(charts.drawable(times)).all()]


def designs(facts: Facts, describe: Describe) -> list[DesignView]:
    """Best, baseline, best of each level and a typical first design, each once, with shapes."""
    levels = [level["name"] for level in facts.header["levels"]]
    wanted: list[tuple[str, Array]] = []
    if facts.result is not None:
        wanted.append(("best", facts.result.x))
    wanted.append(("baseline", np.asarray(facts.header["baseline"], dtype=float)))
    for level in reversed(levels):
        x = best_at(facts.rows, level, facts.run.insights)
        if x is not None:
            wanted.append((f"best of the search at {level}", x))
    if (row := typical_first(facts.rows)) is not None:
        wanted.append((f"typical of generation {row.generation}", row.x))
    views: dict[bytes, DesignView] = {}
    for label, x in wanted:
        if x.tobytes() not in views and (view := describe(x)) is not None and view.parts:
            views[x.tobytes()] = replace(view, label=label)
    return list(views.values())[:DESIGNS]


def cards(facts: Facts, best: DesignView | None) -> list[tuple[str, str, str]]:
    """Key figures: title, value, remark."""
    made: list[tuple[str, str, str]] = []
    its = facts.result
    if its is not None and its.objective is not None:
        c = its.objective
        remark = f"baseline {facts.shown.full(c.median_baseline)}"
        made.append((facts.name, facts.shown.full(c.median_best), remark))
    elif its is not None and its.belief is not None:
        remark = f"estimated for level {its.belief.level}"
        made.append((facts.name, facts.shown.full(its.belief.mean), remark))
    elif its is not None:
        made.append((facts.name, facts.shown.full(its.found.value), f"one run, {its.found.level}"))
    if its is not None and its.filling_time is not None:
        ms, f = display("s", its.filling_time.best), its.filling_time
        remark = f"baseline {ms.full(f.median_baseline, 3)}"
        made.append(("filling time", ms.full(f.median_best, 3), remark))
    elif its is not None and np.isfinite(its.found.filling_time):
        ms = display("s", its.found.filling_time)
        made.append(("filling time", ms.full(its.found.filling_time, 3), "of the same run"))
    if best is not None and best.bound_s is not None:
        ms = display("s", best.bound_s)
        remark = "for this motion"
        if best.bound_any_s is not None:
            remark += f"; {ms.full(best.bound_any_s, 3)} for any"
        made.append(("physical lower bound", ms.full(best.bound_s, 3), remark))
    if facts.stages:
        total = facts.stages[-1]
        failed = f", {total.failed} failed" if total.failed else ""
        cost = f"{number(total.cpu_s / 3600.0, 3)}\u202fCPU h in {total.runs} runs{failed}"
        made.append(("cost in full runs", number(total.work, 3), cost))
    return made
