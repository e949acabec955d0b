"""The course of an assisted search, and the report of it, against a run made by hand."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mfopt.campaign.store import RunDirectory
from mfopt.records.evaluation import Generation
from reports import course_chart, write_report
from reports.answer import answer, found_in
from reports.course import Course, Look, bands, changes, course, ranking, restarts
from reports.rows import read_rows
from reports.units import display

MakeRun = Callable[..., RunDirectory]
RATIO = 6e7 / 9e8  # work of a run at the coarser level, in full runs


def test_work_levels_and_generations_are_those_of_the_runs(make_assisted: MakeRun) -> None:
    run = make_assisted()
    its = course(run, read_rows(run))
    assert its is not None
    ends = [4 * RATIO, 6 * RATIO + 1, 6 * RATIO + 5]
    assert [look.ended for look in its.looks] == pytest.approx(ends)
    assert [look.began for look in its.looks] == pytest.approx([0.0, *ends[:2]])
    assert its.level.tolist() == [0] * 4 + [1, 0, 0] + [1] * 4
    assert its.spent[-1] == pytest.approx(ends[-1])  # confirmation is no part of the search
    assert [(name, end) for name, _, end in bands(its.places)] == [
        ("bullet-300", pytest.approx(ends[1])), ("yade-1000", pytest.approx(ends[2])),
    ]  # fmt: skip
    np.testing.assert_allclose(ranking(its)["certainty"], [0.9, 0.45, 0.3])
    np.testing.assert_array_equal(ranking(its)["runs"], [4, 3, 4])
    assert restarts(its.places) == []


def test_a_search_without_insights_has_no_course(finished_run: RunDirectory) -> None:
    assert course(finished_run, read_rows(finished_run)) is None


def test_level_changes_and_restarts_are_given_with_their_reasons() -> None:
    whys = [("a", "start"), ("a", "converged"), ("b", "level change to b: x and y"),
            ("c", "level change to c, from the start: z"), ("c", ""), ("c", "exchanged"),
            ("d", "level change to d")]  # fmt: skip
    generations = [Generation(n, level, 0, 0.2, 4, "f", why)
                   for n, (level, why) in enumerate(whys, start=1)]  # fmt: skip
    assert changes(generations) == [
        ("R1", 2, "converged"), ("b", 3, "x and y"), ("c", 4, "from the start: z"),
        ("R2", 6, "exchanged"),
    ]  # fmt: skip


def test_level_changes_are_bands_and_other_restarts_are_marked() -> None:
    whys = [("a", "start"), ("a", "converged: tolx"), ("b", "level change to b"), ("b", "")]
    places = [
        (Generation(n, level, 0, 0.2, 4, "f", why), n - 0.5, n + 0.5)
        for n, (level, why) in enumerate(whys, start=1)
    ]
    assert bands(places) == [("a", 0.5, 2.5), ("b", 2.5, 4.5)]
    assert restarts(places) == [1.5]


def test_a_level_named_like_a_mark_hides_no_restart() -> None:
    levels = [("R1", "start"), ("R1", "converged"), ("b", "level change to b: x"), ("b", "")]
    looks = tuple(
        Look(Generation(n, level, 0, 0.2, 4, "f", why), float(n), n + 1.0, None)
        for n, (level, why) in enumerate(levels, start=1)
    )
    empty = np.empty(0)
    history = Course(("R1", "b"), empty, empty.astype(int), empty.astype(bool), looks)
    assert restarts(history.places) == [2.0]


def test_the_figure_names_what_it_shows(make_assisted: MakeRun) -> None:
    run = make_assisted()
    rows, found = found_in(run)
    its = course(run, rows)
    assert its is not None
    assert found is not None
    svg = course_chart.course(its, display("s", [0.1]), "dispersion", found.objective)
    for text in ("[ms]", "bullet-300", "yade-1000", "estimated for the recommended design",
                 "median over fresh seeds", "certainty", "work spent by the search"):  # fmt: skip
        assert text in svg, text
    assert "median over fresh seeds" not in course_chart.course(
        its, display("s", [0.1]), "dispersion", None
    )


def test_the_recommended_design_is_best_although_others_had_lower_values(
    make_assisted: MakeRun,
) -> None:
    run = make_assisted(finished=False)
    rows, found = found_in(run)
    assert found is not None
    np.testing.assert_array_equal(found.x, run.insights[-1].best)
    assert min(r.value for r in rows if r.level == "yade-1000") < found.found.value
    believed = answer(run)["believed"]
    assert believed["objective"] == 0.1
    assert (believed["low"], believed["high"]) == pytest.approx((0.0804, 0.1196))
    assert believed["level"] == "yade-1000"


def test_an_insight_of_another_design_says_nothing_of_the_confirmed_one(
    make_assisted: MakeRun,
) -> None:
    run = make_assisted()
    _, found = found_in(run)
    assert found is not None
    assert found.belief == run.insights[-1]
    run.insights.pop()
    assert "believed" not in answer(run)


@pytest.mark.parametrize("finished", [True, False])
def test_the_report_says_how_the_design_was_chosen(
    finished: bool, make_assisted: MakeRun, tmp_path: Path
) -> None:
    run = make_assisted(finished=finished)
    page = tmp_path / "r.html"
    write_report(run, html=page, pdf=tmp_path / "r.pdf")
    text = " ".join(page.read_text(encoding="utf-8").split())
    for phrase in (
        "How the best design was chosen", "not the design with the lowest single run",
        "estimated by the search", "100.0", "80.40 to 119.6", "95 % probability",
        "<strong>yade-1000</strong> from generation 3 on: converged", "validation",
        "Four aligned panels",
    ):  # fmt: skip
        assert phrase in text, phrase
    assert ("median over fresh seeds</th>" in text) == finished
    assert ("the search estimates to be 100.0" in text) == (not finished)
    assert "Best and median of the finished runs" not in text


def test_where_runs_do_not_scatter_the_report_says_that_the_best_run_was_chosen(
    make_assisted: MakeRun, tmp_path: Path
) -> None:
    run = make_assisted()
    run.insights[-1] = replace(run.insights[-1], deviation=0.0)
    page = tmp_path / "r.html"
    write_report(run, html=page)
    text = " ".join(page.read_text(encoding="utf-8").split())
    assert "So the design of the best run was chosen" in text
    assert ">runs do not scatter</td>" in text
    assert "not the one with the lowest value" not in text


def test_replicates_of_the_planned_search_are_not_called_a_surrogate(
    make_assisted: MakeRun, tmp_path: Path
) -> None:
    run = make_assisted()
    run.header = {**run.header, "method": "cma-es"}
    write_report(run, html=tmp_path / "r.html")
    text = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "mean of its runs" in text
    assert "certainty of each generation" in text
    assert "surrogate" not in text
    assert "could be predicted" not in text


def test_a_run_that_does_not_name_its_method_is_given_none(
    make_assisted: MakeRun, tmp_path: Path
) -> None:
    run = make_assisted()
    run.header = {key: value for key, value in run.header.items() if key != "method"}
    write_report(run, html=tmp_path / "r.html")
    text = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "best estimate of the search was chosen" in text
    assert "CMA-ES" not in text
    assert "surrogate" not in text


def test_the_planned_search_says_that_a_single_value_chose(
    finished_run: RunDirectory, tmp_path: Path
) -> None:
    write_report(finished_run, html=tmp_path / "r.html")
    text = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "lowest value of one run at the finest level" in text
    assert "surrogate" not in text
