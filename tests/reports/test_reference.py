"""Best and baseline on another engine: hand-computed values, and all that can be said."""

import math
from typing import Any

import numpy as np
import pytest

from mfopt.records.evaluation import Purpose, Reference
from mfopt.records.objective import Quantity
from reports.reference import Repeated, lines, ratio, repeated, words
from reports.rows import Row
from reports.units import Display

NOTED = Reference("fine-yade", "yade", "2023.02a")
MS = Display(1e3, "ms")
ASKED = (
    Quantity("filling time", "s", lambda raw: float(raw["t"]), (1e3, "ms")),
    Quantity("left", "-", lambda raw: float(raw["left"]), (1e2, "%")),
)


def row(purpose: Purpose, seed: int, value: float, **given: Any) -> Row:
    fields: dict[str, Any] = {
        "index": 0, "generation": 0, "level": "fine", "seed": seed, "purpose": purpose,
        "x": np.zeros(1), "value": value, "quantities": {"filling time": 2.0 * value, "left": 0.03},
        "status": "finished", "why": None, "work": 1.0, "cpu_s": 1.0,
    }  # fmt: skip
    return Row(**(fields | given))


CONFIRMED = [
    *(row("confirm best", seed, f) for seed, f in ((7, 0.10), (8, 0.12), (9, 0.11))),
    *(row("confirm baseline", seed, f) for seed, f in ((7, 0.20), (8, 0.24), (9, 0.22))),
]


def made(best: float, baseline: float, **given: Any) -> Repeated:
    """Both designs confirmed with three seeds, and run on the reference engine."""
    there = [row("reference best", 7, best, **given), row("reference baseline", 7, baseline)]
    its = repeated([*CONFIRMED, *there], NOTED)
    assert its is not None
    return its


def said(its: Repeated) -> str:
    return words(its, "numba", MS).replace("\u202f", " ")


def test_each_design_stands_beside_its_run_with_the_same_seed() -> None:
    there = made(0.11, 0.19, quantities={"filling time": 0.22, "left": 0.0})
    objective, filling, left = lines(there, "objective", MS, ASKED)
    assert objective == [
        "objective [ms]", "110.0", "100.0", "1.10", "190.0", "200.0", "0.950"
    ]  # fmt: skip
    assert filling[1:4] == ["220.0", "200.0", "1.10"]
    assert left == ["left [%]", "0", "3.000", "0", "3.000", "3.000", "1.00"]


def test_a_design_that_has_not_been_run_there_has_dashes() -> None:
    rows = [row("confirm best", 7, 0.1), row("reference best", 7, 0.2)]
    its = repeated(rows, NOTED)
    assert its is not None
    assert [line[0] for line in lines(its, "f", MS, ())] == ["f [ms]"]
    assert lines(its, "f", MS, ())[0][4:] == ["\u2013"] * 3


@pytest.mark.parametrize(("there", "here"), [(1.0, 0.0), (1.0, math.nan), (math.inf, 1.0)])
def test_no_ratio_where_it_means_nothing(there: float, here: float) -> None:
    assert ratio(there, here) == "\u2013"


@pytest.mark.parametrize(
    ("best", "place"), [(0.09, "below"), (0.10, "within"), (0.115, "within"), (0.13, "above")]
)
def test_it_says_where_the_run_lies_among_the_confirmation_runs(best: float, place: str) -> None:
    text = said(made(best, 0.22))
    shown = MS.full(best).replace("\u202f", " ")
    assert (
        f"The objective of the best design, {shown}, lies {place} the range of its 3 runs" in text
    )
    assert "100.0 to 120.0 ms" in text
    assert "can contradict the result, but not prove it" in text


def test_the_chance_to_lie_outside_the_range_is_two_in_n_plus_one() -> None:
    rng = np.random.default_rng(2)
    draws = rng.exponential(size=(40_000, 4))
    outside = (draws[:, 3] < draws[:, :3].min(axis=1)) | (draws[:, 3] > draws[:, :3].max(axis=1))
    assert outside.mean() == pytest.approx(1 / 2, abs=0.01)
    assert "outside the range of 3 in 1 of 2 cases" in said(made(0.11, 0.22))


@pytest.mark.parametrize(
    ("best", "baseline", "verdict"),
    [
        (0.11, 0.22, "The best design is better than the baseline there, too, by 50.0 %, on numba "
                     "with the same seed by 50.0 %."),
        (0.22, 0.22, "not better than the baseline there, contrary to the result"),
        (0.30, 0.22, "not better than the baseline there, contrary to the result"),
    ],
)  # fmt: skip
def test_it_says_whether_the_best_design_is_better_there(
    best: float, baseline: float, verdict: str
) -> None:
    assert verdict in said(made(best, baseline))


def test_a_best_design_that_was_not_confirmed_is_not_called_contradicted() -> None:
    worse = [row("confirm best", 7, 0.3), row("confirm baseline", 7, 0.2)]
    for best, verdict in ((0.1, "but not on numba with the same seed"), (0.3, "nor on numba")):
        there = [row("reference best", 7, best), row("reference baseline", 7, 0.2)]
        its = repeated([*worse, *there], NOTED)
        assert its is not None
        assert verdict in said(its)
        assert "contrary to the result" not in said(its)


def test_a_failed_run_is_told_with_its_reason_and_decides_nothing() -> None:
    its = made(math.inf, 0.22, status="crashed", why="exploded at 0.1 s\nlog\nlog")
    assert "The run of the best design failed: exploded at 0.1 s." in said(its)
    assert "better" not in said(its)
    assert lines(its, "f", MS, ())[0][1:4] == ["failed", "100.0", "\u2013"]


def test_what_is_missing_is_said() -> None:
    assert repeated(CONFIRMED, None) is None
    waiting = repeated(CONFIRMED, NOTED)
    assert waiting is not None
    assert said(waiting) == "The reference run on yade 2023.02a has not been made yet."
    left_out = repeated(CONFIRMED, Reference(why_not="yade is not installed"))
    assert left_out is not None
    assert said(left_out) == "The reference run is skipped: yade is not installed."
