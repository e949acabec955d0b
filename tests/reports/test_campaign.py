"""What a search cost and how it went, against hand-computed values."""

import math
from typing import get_args

import numpy as np
import pytest

from mfopt.campaign.store import RunDirectory
from mfopt.records.evaluation import Generation, Purpose
from reports.campaign import PHASES, cost_words, costs, failures, reason, stages, steps
from reports.rows import Row, read_rows


def row(generation: int, value: float, *, level: str = "a", work: float = 1.0, cpu_s: float = 1.0,
        purpose: str = "search", why: str | None = None) -> Row:  # fmt: skip
    return Row(0, generation, level, 1, purpose, np.zeros(1), value, {},  # type: ignore[arg-type]
               "crashed" if why else "finished", why, work, cpu_s)  # fmt: skip


def generation(number: int, level: str = "a", size: int = 2, objective: str = "f") -> Generation:
    return Generation(number, level, 0, 0.2, size, objective)


def test_steps_leave_failed_runs_out_of_best_and_median_but_count_them() -> None:
    rows = [row(1, 3.0), row(1, 1.0), row(1, math.inf, why="exploded"), row(2, math.inf, why="x")]
    first, second, third = steps([generation(1), generation(2), generation(3)], rows)
    assert (first.best, first.median, first.runs, first.failed) == (1.0, 2.0, 3, 1)
    assert math.isnan(second.best)
    assert (second.runs, second.failed) == (1, 1)
    assert (third.runs, third.failed) == (0, 0)  # begun, nothing back yet


def test_a_stage_ends_where_level_population_or_objective_change() -> None:
    generations = [generation(1), generation(2), generation(3, size=4),
                   generation(4, size=4, objective="g"), generation(5, level="b")]  # fmt: skip
    rows = [*(row(n, 1.0) for n in range(1, 5)), row(5, 1.0, level="b")]
    made = stages(generations, rows, 1.0)
    assert [s.generations for s in made] == ["1\u20132", "3", "4", "5", ""]
    assert made[-1].level == "all"


def test_validations_have_a_line_of_their_own() -> None:
    rows = [row(1, 1.0), row(1, 1.0), row(2, 1.0, level="b", work=4.0), row(3, 1.0, level="b")]
    made = stages([generation(1), generation(2), generation(3, level="b")], rows, 4.0)
    assert [(s.level, s.purpose, s.runs) for s in made] == [
        ("a", "search by f", 2), ("b", "validation", 1), ("b", "search by f", 1), ("all", "", 4),
    ]  # fmt: skip
    assert made[1].work == 1.0


def test_work_is_counted_in_full_runs_and_confirmation_belongs_to_the_total() -> None:
    rows = [row(1, 1.0, work=2.0, cpu_s=1.0), row(1, 2.0, work=4.0, cpu_s=3.0),
            row(0, 1.0, work=8.0, cpu_s=5.0, purpose="confirm best")]  # fmt: skip
    search, confirmation, total = stages([generation(1)], rows, 8.0)
    assert (search.work, confirmation.work, total.work) == (0.75, 1.0, 1.75)
    assert (search.mean_cpu_s, search.std_cpu_s) == pytest.approx((2.0, math.sqrt(2.0)))
    assert total.cpu_s == 9.0


def test_stages_of_a_run_hold_every_evaluation_and_all_its_work(finished_run: RunDirectory) -> None:
    rows = read_rows(finished_run)
    *parts, total = stages(finished_run.generations, rows, 9e8)
    assert sum(s.runs for s in parts) == total.runs == len(finished_run)
    assert sum(s.failed for s in parts) == total.failed > 0
    assert sum(s.work for s in parts) == pytest.approx(total.work)
    assert sum(s.cpu_s for s in parts) == pytest.approx(sum(r.cpu_s for r in rows))


def test_failures_are_counted_by_reason_most_frequent_first() -> None:
    rows = [row(1, math.inf, why="hung"), row(1, 1.0), row(2, math.inf, why="exploded"),
            row(2, math.inf, why="exploded", level="b")]  # fmt: skip
    exploded, hung = failures(rows)
    assert (exploded.why, exploded.count, exploded.levels) == ("exploded", 2, "a, b")
    assert (hung.why, hung.count) == ("hung", 1)


def test_a_run_that_gave_no_number_is_a_failure_with_a_reason() -> None:
    (failure,) = failures([row(1, math.inf)])
    assert failure.status == "no number"
    assert failure.why


def test_the_same_failure_is_listed_once_without_its_numbers_and_folders() -> None:
    whys = [
        f"energy grew past 10 J at 0.{n} s; see /var/tmp/mfopt-yade-8gk{n}__1/log.txt"
        for n in range(12, 15)
    ]
    rows = [*(row(1, math.inf, why=why) for why in whys), row(1, math.inf, why="no licence")]
    grown, other = failures(rows)
    assert grown.count == 3
    assert grown.why == "energy grew past 10 J at 0.12 s; see log.txt"
    assert other.why == "no licence"


def test_a_long_log_keeps_its_beginning_and_its_end() -> None:
    why = reason("begins " + "x" * 5000 + " Segmentation fault")
    assert len(why) < 700
    assert why.startswith("begins")
    assert why.endswith("Segmentation fault")


def test_search_confirmation_and_reference_are_told_apart() -> None:
    purposes = ["search", "search", "confirm best", "confirm baseline", "reference best"]
    rows = [row(1, 1.0, purpose=purpose, work=2.0, cpu_s=90.0) for purpose in purposes]
    made = costs(rows, 4.0)
    assert [(c.phase, c.runs, c.work) for c in made] == [
        ("search", 2, 1.0), ("confirmation", 2, 1.0), ("reference", 1, 0.5),
    ]  # fmt: skip
    assert cost_words(made[0]) == "1.00 full runs, 3.0\u202fCPU\u202fmin"


def test_every_purpose_has_a_phase() -> None:
    assert {p.split()[0] for p in get_args(Purpose)} == PHASES.keys()


def test_a_search_for_what_a_program_returns_is_just_a_search() -> None:
    own = generation(1, objective="returned")
    assert stages([own], [row(1, 1.0)], 1.0)[0].purpose == "search"
