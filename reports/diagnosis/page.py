"""The contents of a diagnosis' report, computed once for HTML and PDF."""

from typing import Any

from mfopt.campaign.store import RunDirectory
from mfopt.records.calibration import chance
from mfopt.records.diagnosis import Diagnosis
from reports.calibration.sentences import typeset
from reports.calibration.units import words
from reports.campaign import hours
from reports.diagnosis import tables
from reports.diagnosis.figures import figures
from reports.origin import origin
from reports.plain import plain, readable, readable_run

KINDS = {
    "nothing": "nothing is missing",
    "named": "an effect is named",
    "set": "one of a few effects",
    "partly": "a main part is found",
    "unknown": "something unknown",
}


def context(given: RunDirectory, found: Diagnosis) -> dict[str, Any]:
    """Everything that the templates name: text, numbers, SVG drawings."""
    run, its = readable_run(given), readable(found)
    lines = [typeset(line) for line in its.words]
    return {
        "name": its.name,
        "sentence": lines[0],
        "answers": lines[1:-1],
        "cards": cards(its),
        "suspects": tables.suspects(its),
        "parameters": tables.parameters(its),
        "places": tables.places(its),
        "votes": tables.votes(its),
        "held_out": tables.held_out(its),
        "next": tables.next_recordings(its),
        "faint": [words(s.name) for s in its.suspects if s.faint],
        "figures": figures(its),
        "cost": lines[-1],
        "facts": origin(run, "diagnosis"),
        "case": plain(run.study()),
    }


def cards(its: Diagnosis) -> list[tuple[str, str, str]]:
    """Key figures: what is said, how sure, held-out error, cost."""
    suspects = {s.name: s for s in its.suspects}
    made = []
    if its.kind == "named":
        for name in its.effects:
            made.append(("missing", words(name), f"probability {suspects[name].probability:.2f}"))
    else:
        made.append(("verdict", KINDS[its.kind], f"probability {its.probability:.2f}"))
    made.append(
        ("p-value of the mismatch", chance(its.mismatch), "how often chance alone looks as bad")
    )
    if its.held_out:
        last = its.held_out[-1]
        value = f"{last.before:.2f}"
        if its.kind != "nothing":
            value = f"{value} to {last.after:.2f}"
        made.append(("held-out error", value, "standard deviations of the repeats"))
    runs = its.library_runs + its.runs
    failed = f"{its.failed} failed" if its.failed else "none failed"
    made.append(("cost", f"{runs} runs", f"{hours(its.cpu_s)}, {failed}"))
    return made
