"""Progress in words: phases, and work in runs of the target level."""

import io
import re
from typing import Any

import numpy as np
from rich.console import Console

from mfopt.evaluation import Candidate, Evaluation, Insight, Purpose
from mfopt.outcome import Outcome
from mfopt.progress import ProgressDisplay
from mfopt.run import Progress

WORK = {"fine": 10.0, "fine-yade": 300.0}


def shown(
    *runs: tuple[str, int, Purpose], left: int = 0, insight: Insight | None = None, **given: Any
) -> list[str]:
    """What is printed for runs of a level, a generation and a purpose."""
    console = Console(file=io.StringIO(), width=200)
    display = ProgressDisplay(
        console, work=WORK, full_run=10.0, unit="s", confirm_work=620.0, **given
    )
    x = np.zeros(1)
    with display:
        for level, generation, purpose in runs:
            outcome = Outcome(x, level, 1, "finished")
            candidate = Candidate(0, x, level, 1, generation, purpose)
            its = Evaluation(candidate, outcome, 0.5)
            display.watch(Progress(its, [("fine", left)], replayed=False, insight=insight))
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
    assert [line.split("  ")[1] for line in lines] == [
        "best 0.4 \u00b1 0.02 s (estimated for fine)"
    ] * 3
    assert [line.split("  ")[2] for line in lines] == [
        "work 1.0 of 64.0 full runs", "work 2.0 of 64.0 full runs", "work 3.0 of 64.0 full runs",
    ]  # fmt: skip
