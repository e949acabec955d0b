"""The contents of a report page, computed once for HTML and PDF."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mfopt.arrays import Array
from mfopt.campaign.store import RunDirectory
from mfopt.records.view import Describe, DesignView
from reports import campaign, pictures, reference, tables, viewer
from reports.course import changes
from reports.facts import Facts, gather
from reports.figures import Shown, assisted, figures
from reports.needs import SIMPLE, Need, needs
from reports.plain import plain
from reports.result import best_at, solutions, typical_first
from reports.sentence import chosen, sentence, state
from reports.units import MISSING, display, number

ORIGIN = ("study", "mfopt_version", "platform", "created", "workers", "seed")  # of the header
AFTER = ("confirm", "reference")  # purposes of runs on seeds that no run before them had
DESIGNS = 6  # shapes shown at most: two rows of a page


def context(run: RunDirectory, describe: Describe) -> dict[str, Any]:
    """Everything that the templates name: text, numbers, SVG drawings, PNG pictures."""
    facts = gather(run)
    run, found = facts.run, facts.result
    best = None if found is None else describe(found.x)
    baseline = describe(np.asarray(facts.header["baseline"], dtype=float))
    views = designs(facts, describe)
    shapes = pictures.shapes(views)
    return {
        "header": {name: facts.header[name] for name in ORIGIN},
        "versions": _versions(run),
        "material": list(facts.header.get("material", [])),  # sentences
        "study": _study(run),
        "end": run.end,
        "state": state(run.end, facts.rows),
        "sentence": sentence(
            found, facts.rows, facts.name, facts.shown, facts.quantities, ended=run.end is not None
        ),
        "name": facts.name,
        "work_head": _work_head(facts),
        "unit": facts.shown.unit,
        "result": found is not None,
        "assisted": assisted(facts),
        "has_course": facts.course is not None,
        "chosen": found
        and chosen(
            found,
            method=facts.header.get("method"),
            insights=bool(run.insights),
            finalists=len({r.x.tobytes() for r in facts.rows if r.purpose == "finalist"}),
        ),
        "best": best and _shown(best),
        "cards": cards(facts, best),
        "needs": needed(facts),
        "designs": [(v.label, picture) for v, picture in zip(views, shapes, strict=True)],
        "scene": viewer.scene(views) if views else None,
        **_tables(facts),
        "figures": figures(Shown(facts, best, baseline)),
    }


def _work_head(facts: Facts) -> str:
    """Head of the column of predicted work; the unit is sphere-steps if levels have grains."""
    grains = any(level["grains"] for level in facts.header["levels"])
    return "work [sphere-steps]" if grains else "work, as the study states it"


def needed(facts: Facts) -> dict[str, Any] | None:
    """The table of what the machine needs: a line for each quantity, a cell for each design."""
    lines = needs(facts.rows, facts.result, facts.quantities)
    if not lines or facts.result is None:
        return None
    designs = list(lines[0].spreads)
    seeds = len(facts.result.confirmations)
    one = f"The best design has one run, at level {facts.result.found.level}."
    over = f"Medians over {seeds} fresh seed{'s' * (seeds != 1)} at the target level"
    rivals = "; the best start over those of the finalists" if SIMPLE in designs else ""
    return {
        "caption": f"{over}{rivals}, with the range of the runs." if seeds else one,
        "designs": designs,
        "lines": [
            (line.label, line.asked, [_cell(line, design) for design in designs]) for line in lines
        ],
    }


def _cell(line: Need, design: str) -> tuple[str, str, str]:
    """Median, range and fault."""
    if design not in line.spreads:
        return MISSING, "", ""
    return line.text(line.spreads[design].median), line.range(design), line.fault(design)


def _shown(best: DesignView) -> dict[str, Any]:
    return {
        "notes": list(best.notes),
        "mover": best.mover,
        "bound_note": best.bound_note,
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
    found, header = facts.result, facts.header
    levels = [level["name"] for level in header["levels"]]
    chosen_x = None if found is None else found.x
    best = solutions(facts.rows, levels, insights=facts.run.insights, chosen_x=chosen_x)
    asked = facts.quantities
    coverage = None
    if found is not None and found.objective is not None:
        interval = found.objective.reduction_interval
        coverage = None if interval is None else f"{100 * interval.coverage:.1f}"
    return {
        "variables": tables.variables(header, None if found is None else found.x),
        "ladder": tables.ladder(header),
        "comparison": tables.comparison_lines(found, facts.name, facts.shown, asked)
        if found
        else [],
        "coverage": coverage,
        "confirmations": tables.confirmations(found, facts.shown, asked) if found else [],
        "reference": _reference(facts),
        "solutions": tables.best_solutions(header, best, facts.shown, asked) if best else [],
        "work": tables.work(facts.stages),
        "assisted": facts.header.get("method") == "assisted",  # the search has a budget
        "failures": campaign.failures(facts.rows),
        "belief": tables.belief_lines(found, facts.shown) if found else [],
        "changes": changes(facts.run.generations),
        "seeds": sorted({r.seed for r in facts.rows if not r.purpose.startswith(AFTER)}),
        "asked": [tables.label_of(q) for q in asked],
        "fresh_seeds": sorted({r.seed for r in facts.rows if r.purpose.startswith(AFTER)}),
    }


def _reference(facts: Facts) -> dict[str, Any] | None:
    """The runs of best and baseline on another engine; None if the study asks for none."""
    runs = reference.repeated(facts.rows, facts.run.reference)
    if runs is None:
        return None
    top = facts.header["levels"][-1]
    return {
        "words": reference.words(runs, top["engine"], facts.shown),
        "columns": [runs.noted.engine, top["engine"], "ratio"],
        "lines": reference.lines(runs, facts.name, facts.shown, facts.quantities)
        if any(runs.pairs.values())
        else [],
    }


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
    found = facts.result
    if found is not None and found.objective is not None:
        c = found.objective
        remark = f"baseline {facts.shown.full(c.median_baseline)}"
        made.append((facts.name, facts.shown.full(c.median_best), remark))
    elif found is not None and found.belief is not None:
        remark = f"estimated for level {found.belief.level}"
        made.append((facts.name, facts.shown.full(found.belief.mean), remark))
    elif found is not None:
        made.append(
            (facts.name, facts.shown.full(found.found.value), f"one run, {found.found.level}")
        )
    if best is not None and best.bound is not None:
        ms = display("s", best.bound)
        remark = "for this motion"
        if best.bound_any is not None:
            remark += f"; {ms.full(best.bound_any, 3)} for any"
        made.append(("physical lower bound", ms.full(best.bound, 3), remark))
    if facts.costs:
        made.append(_cost_card(facts.costs))
    return made


def _cost_card(costs: Sequence[campaign.Cost]) -> tuple[str, str, str]:
    """The cost of the search, and separately of the other phases."""
    search = [cost for cost in costs if cost.phase in campaign.OF_SEARCH]
    parts = [f"{number(c.work, 3)} {c.phase}" for c in costs if c.phase not in campaign.OF_SEARCH]
    runs, failed = sum(c.runs for c in costs), sum(c.failed for c in costs)
    lost = f", {failed} failed" if failed else ""
    total = f"{campaign.hours(sum(c.cpu_s for c in costs))} in {runs} runs{lost}"
    work = number(sum(cost.work for cost in search), 3)
    remark = "; ".join(filter(None, (", ".join(parts) and f"besides {', '.join(parts)}", total)))
    return "search, in full runs", work, remark
