"""Progress in words: phases, and work in runs of the target level."""

import io
import re
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from mfopt.campaign.driver import Progress
from mfopt.commands.progress import ProgressDisplay, fitted
from mfopt.records.evaluation import Candidate, Evaluation, Insight, Purpose
from mfopt.records.outcome import Outcome

WORK = {"fine": 10.0, "fine-yade": 300.0}


def shown(
    *runs: tuple[str, int, Purpose],
    left: int = 0,
    insight: Insight | None = None,  # after each run of the search
    unit: str = "s",
    terminal: bool = False,
    **given: Any,
) -> list[str]:
    """What is printed for runs of a level, a generation and a purpose."""
    console = Console(file=io.StringIO(), width=80, force_terminal=terminal, color_system=None)
    after = {"fine": 20.0, "fine-yade": 600.0}
    display = ProgressDisplay(console, work=WORK, full_run=10.0, unit=unit, after=after, **given)
    x = np.zeros(1)
    with display:
        for level, generation, purpose in runs:
            outcome = Outcome(x, level, 1, "finished")
            candidate = Candidate(0, x, level, 1, generation, purpose)
            its = Evaluation(candidate, outcome, 0.5)
            now = insight if purpose == "search" else None
            display.watch(Progress(its, [("fine", left)], replayed=False, insight=now))
    assert isinstance(console.file, io.StringIO)
    return [line for line in console.file.getvalue().splitlines() if line]


def test_a_line_for_each_generation_and_each_phase_after_it() -> None:
    lines = shown(
        ("fine", 1, "search"), ("fine", 1, "search"), ("fine", 2, "search"),
        ("fine", 0, "confirm best"), ("fine", 0, "confirm baseline"),
        ("fine-yade", 0, "reference best"), ("fine-yade", 0, "reference baseline"),
    )  # fmt: skip
    assert [line.split("  best")[0] for line in lines] == [
        "generation 1 on fine", "generation 2 on fine", "confirming on fine",
        "reference run on fine-yade",
    ]  # fmt: skip


def test_work_is_told_in_runs_of_the_target_level_and_the_reference_is_planned() -> None:
    first, _, reference = shown(
        ("fine", 1, "search"), ("fine", 0, "confirm best"), ("fine-yade", 0, "reference best")
    )
    spent_and_all = re.compile(r"work (\S+) of (\S+) full runs")
    assert [m.groups() for m in map(spent_and_all.search, (first, reference)) if m] == [
        ("1.0", "63.0"), ("32.0", "63.0"),
    ]  # fmt: skip


def test_a_generation_is_told_once_although_results_of_two_overlap() -> None:
    runs = [("fine", n, "search") for n in (1, 2, 1, 2)]
    lines = shown(*runs)  # type: ignore[arg-type]
    assert [line.split("  ")[0] for line in lines] == [
        "generation 1 on fine",
        "generation 2 on fine",
    ]


def test_a_budget_fixes_the_total_and_the_prediction_is_the_best() -> None:
    its = Insight(1, 0.9, 4, "fine", (0.0,), 0.4, 0.01)
    lines = shown(
        ("fine", 1, "search"), ("fine", 2, "search"), ("fine", 0, "confirm best"),
        left=17, budget=20.0, insight=its,
    )  # fmt: skip
    assert [line.split("  ")[1] for line in lines] == ["best 0.4 (0.38 to 0.42) s"] * 3
    assert [line.split("  ")[2] for line in lines] == [
        "work 1.0 of 64.0 full runs", "work 2.0 of 64.0 full runs", "work 3.0 of 64.0 full runs",
    ]  # fmt: skip


def test_where_runs_do_not_scatter_no_interval_is_shown() -> None:
    its = Insight(1, 0.9, 4, "fine", (0.0,), 0.4, 0.0)
    (line,) = shown(("fine", 1, "search"), insight=its)
    assert "best 0.4 s  " in line


@pytest.mark.parametrize("unit", ["s", "[/]", "$\\foo$", "x" * 100])
@pytest.mark.parametrize("terminal", [False, True])
def test_any_unit_is_text_and_a_line_fits_the_smallest_terminal(unit: str, terminal: bool) -> None:
    its = Insight(1, 0.9, 4, "fine", (0.0,), -1.2345e-300, 1.7e308)
    lines = shown(
        ("fine", 123456, "search"), ("fine", 0, "confirm best"), left=10**300, insight=its,
        unit=unit, terminal=terminal,
    )  # fmt: skip
    text = re.sub(r"\x1b\[[0-9?;]*[A-Za-z]", "", "\n".join(lines))
    assert all(len(line) <= 80 for line in text.replace("\r", "\n").split("\n"))
    assert "generation 123456" in text or terminal  # a bar shows what came last


def test_what_matters_least_is_left_out_first() -> None:
    parts = ["generation 3 on fine", "best 0.4 s", "work 1 of 9 full runs", "about 8 min to go"]
    assert fitted(parts, 80) == "  ".join(parts)
    assert fitted(parts, 60) == "generation 3 on fine  best 0.4 s  about 8 min to go"
    assert fitted(parts, 40) == "generation 3 on fine  about 8 min to go"
    assert fitted(parts, 25) == "gener\u2026  about 8 min to go"


def test_after_the_search_its_estimate_is_shown_on() -> None:
    its = Insight(3, 1.0, 4, "fine", (0.0,), mean=0.07, deviation=0.001)
    lines = shown(("fine", 1, "search"), ("fine", 0, "confirm best"), insight=its)
    assert all("best 0.07 (0.068 to 0.072)" in line for line in lines)
    assert len(lines) == 2
