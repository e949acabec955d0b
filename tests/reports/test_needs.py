"""The table of what the machine needs, against hand-made runs."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from fidelity.scenes.discharge import objectives as discharge
from fidelity.scenes.dosing.objectives import Weights, criteria
from mfopt.records.evaluation import Purpose
from mfopt.records.objective import Quantity
from reports.needs import SIMPLE, Need, needs
from reports.result import result
from reports.rows import Row

LIMITED = criteria(Weights(filling_time_limit_s=0.33)).quantities
UNLIMITED = criteria().quantities
BEST, BASELINE, MOTION = 1.0, 2.0, 3.0


def row(purpose: Purpose, x: float, value: float, **given: Any) -> Row:
    fields: dict[str, Any] = {
        "index": 0, "generation": 0, "level": "fine", "seed": 1, "purpose": purpose,
        "x": np.array([x]), "value": value, "status": "finished",
        "why": None, "work": 1.0, "cpu_s": 1.0,
    }  # fmt: skip
    asked = {"dispersion": value, "filling time": 3.0 * value, "mass left": 0.0}
    changed = {name.replace("_", " "): given.pop(name) for name in ("mass_left",) if name in given}
    return Row(quantities=given.pop("quantities", asked | changed), **(fields | given))


def confirmed(best: list[float], baseline: list[float], **of_best: Any) -> list[Row]:
    return [
        *(row("confirm best", BEST, f, seed=s, **of_best) for s, f in enumerate(best)),
        *(row("confirm baseline", BASELINE, f, seed=s) for s, f in enumerate(baseline)),
    ]


def table(rows: list[Row], asked: Sequence[Quantity] = LIMITED) -> dict[str, Need]:
    lines = needs(rows, result(rows, ["fine"]), asked)
    return {line.name: line for line in lines}


def test_medians_and_ranges_of_best_and_baseline() -> None:
    its = table(confirmed([0.09, 0.07, 0.08], [0.1, 0.1, 0.1]))
    assert list(its) == ["dispersion", "filling time", "mass left"]
    assert its["dispersion"].spreads["best"].median == 0.08
    assert its["dispersion"].range("best") == "70.0 to 90.0"
    assert its["dispersion"].range("baseline") == ""  # all runs agree
    assert all(line.fault(design) == "" for line in its.values() for design in line.spreads)


def test_what_got_worse_or_breaks_the_limit_is_said() -> None:
    its = table(confirmed([0.12, 0.12, 0.09], [0.1, 0.1, 0.1], mass_left=0.01))
    assert its["dispersion"].fault("best") == "worse than the baseline"
    assert its["mass left"].fault("best") == "worse than the baseline"
    assert its["filling time"].fault("best") == (
        "above the limit in 2 of 3 runs, worse than the baseline"
    )
    assert its["filling time"].fault("baseline") == ""


def test_without_a_limit_none_is_broken() -> None:
    its = table(confirmed([0.2], [0.3]), UNLIMITED)["filling time"]
    assert its.limit is None
    assert its.fault("best") == ""


def test_a_difference_that_is_not_shown_is_not_called_worse() -> None:
    its = table(confirmed([0.100001], [0.1]))["dispersion"]
    assert its.fault("best") == ""


def test_failed_runs_are_told_and_left_out_of_the_median() -> None:
    rows = confirmed([0.08, 0.09], [0.1, 0.1, 0.1])
    rows.append(row("confirm best", BEST, np.inf, seed=3, quantities={}))
    its = table(rows)["dispersion"]
    assert its.spreads["best"].median == pytest.approx(0.085)
    assert its.fault("best") == "1 of 3 runs failed"


def test_the_best_of_the_simple_motions_stands_beside_them_if_it_was_a_finalist() -> None:
    rows = [
        row("start", BASELINE, 0.10), row("start", MOTION, 0.09), row("start", 4.0, 0.2),
        row("finalist", BEST, 0.07), row("finalist", MOTION, 0.08), row("finalist", MOTION, 0.09),
        *confirmed([0.07], [0.1]),
    ]  # fmt: skip
    its = table(rows)["dispersion"]
    assert list(its.spreads) == ["best", "baseline", SIMPLE]
    assert its.spreads[SIMPLE].median == pytest.approx(0.085)
    without = [r for r in rows if r.purpose != "finalist"]
    assert list(table(without)["dispersion"].spreads) == ["best", "baseline"]


def test_a_simple_motion_that_is_the_best_design_stands_there_once() -> None:
    rows = [row("start", BEST, 0.09), row("finalist", BEST, 0.08), *confirmed([0.07], [0.1])]
    assert list(table(rows)["dispersion"].spreads) == ["best", "baseline"]


def test_runs_of_another_kind_have_no_such_table() -> None:
    rows = [
        row("confirm best", BEST, 0.1, quantities={}),
        row("confirm baseline", 2.0, 0.1, quantities={}),
    ]
    assert table(rows) == {}
    assert needs([], None, LIMITED) == ()


def test_the_wanted_value_stands_beside_the_quantity() -> None:
    flow = discharge.criteria(discharge.Wanted(mass_flow_rate_kg_s=0.45)).quantities
    given = {"mass flow rate": 0.341, "discharge time": 0.8, "mass left": 0.0}
    line = table([row("confirm best", BEST, 0.2, quantities=given)], flow)["mass flow rate"]
    assert line.asked == "wanted 450"
    assert line.sentence() == "wanted 450, best 341"


def test_a_run_without_a_value_has_not_failed() -> None:
    rows = confirmed([0.09, 0.07, 0.08], [0.1, 0.1, 0.1])
    rows[0] = row("confirm best", BEST, 0.09, seed=0, quantities={"dispersion": 0.09})
    assert table(rows)["filling time"].fault("best") == "no value in 1 of 3 runs"
