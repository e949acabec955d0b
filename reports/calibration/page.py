"""The contents of a calibration's report, computed once for HTML and PDF."""

from typing import Any

from mfopt.campaign.store import RunDirectory
from mfopt.records.calibration import Summary, read_fit_cost
from reports import campaign
from reports.calibration import sentences, tables
from reports.calibration.figures import figures
from reports.origin import origin
from reports.plain import plain, readable, readable_run
from reports.rows import read_rows

CARDS = 3  # parameters at most that have one: with the others, one row of a page


def context(given: RunDirectory, found: Summary) -> dict[str, Any]:
    """Everything that the templates name: text, numbers, SVG drawings."""
    run, its = readable_run(given), readable(found)
    rows = read_rows(run)
    return {
        "name": its.name,
        "sentence": sentences.sentence(its),
        "warnings": [sentences.typeset(line) for line in its.warnings],
        "fit": sentences.fit(its),
        "misfit": sentences.misfit(its),
        "cards": cards(its),
        "parameters": tables.parameters(its),
        "undetermined": sentences.undetermined(its),
        "combinations": bool(its.combinations),
        "further": [sentences.typeset(line) for line in its.further],
        "advice_head": tables.advice_head(its),
        "advice": tables.advice(its) if its.fits else [],
        "without_head": tables.without_head(its),
        "without": tables.without(its) if its.without else [],
        "check": [sentences.typeset(line) for line in its.check],
        "emulators": tables.emulators(its.emulators),
        "offsets": tables.offsets(its.offsets),
        "errors": tables.errors(its.compared),
        "recordings": tables.recordings(its.recordings),
        "notes": list(its.notes),
        "noise": tables.noise(its.noise),
        "cost": tables.cost(rows),
        "fit_cost": _fit_cost(run),
        "failures": campaign.failures(rows),
        "figures": figures(its, run.path),
        "facts": origin(run, "calibration"),
        "case": plain(run.study()),
    }


def cards(its: Summary) -> list[tuple[str, str, str]]:
    """Key figures: the parameters that are asked for, held-out error and cost."""
    made = []
    for p in [p for p in its.parameters if p.asked][:CARDS]:
        value = sentences.value(p) if p.determined else "not determined"
        said = f"{sentences.interval(p)} (90\u202f%)"
        made.append((p.name, value, said if its.fits else f"{said}, of a wrong model"))
    if errors := [c.error for c in its.compared if c.held_out]:
        made.append(
            (
                "held-out error",
                f"{max(errors):.2f}",
                "times what noise, scatter and stated errors explain, at most",
            )
        )
    failed = f"{its.failed} failed" if its.failed else "none failed"
    made.append(("cost", f"{its.runs} runs", f"{campaign.hours(its.cpu_s)}, {failed}"))
    return made


def _fit_cost(run: RunDirectory) -> str:
    """What the fit itself cost, in a sentence; empty where nobody measured it."""
    cpu_s = read_fit_cost(run.path)
    return "" if cpu_s is None else f"Emulators and posterior took {campaign.hours(cpu_s)}."
