"""What the figures mark, and that every axis carries its unit."""

import itertools
from collections.abc import Callable

import numpy as np
import pytest
from matplotlib.figure import Figure

from conftest import CRITERIA
from mfopt.arrays import Array
from mfopt.campaign.store import RunDirectory
from mfopt.records.evaluation import Generation
from mfopt.records.view import DesignView
from reports import charts, course_chart
from reports.campaign import Step, steps
from reports.facts import gather
from reports.rows import read_rows
from reports.units import display


def step(number: int, level: str, why: str = "", best: float = 1.0) -> Step:
    return Step(Generation(number, level, 0, 0.2, 4, "f", why), best, 2 * best, {}, 4, 0)


def test_labels_in_a_row_never_overlap() -> None:
    rng = np.random.default_rng(4)
    lefts = np.sort(rng.random(30)).tolist()
    names = ["level " + "x" * int(n) for n in rng.integers(1, 20, 30)]
    rows = charts.label_rows(lefts, names)
    for row in set(rows):
        its = [(x, n) for x, n, r in zip(lefts, names, rows, strict=True) if r == row]
        for (x, name), (following, _) in itertools.pairwise(its):
            assert x + 0.011 * len(name) < following


@pytest.mark.parametrize(("value", "rounded"), [(3.59, 4.0), (0.012, 0.02), (1.0, 1.0), (0.0, 1.0)])
def test_scales_end_on_round_numbers(value: float, rounded: float) -> None:
    assert charts.round_up(value) == pytest.approx(rounded)


def test_progress_names_units_levels_restarts_and_failures(finished_run: RunDirectory) -> None:
    its = steps(finished_run.generations, read_rows(finished_run))
    svg = charts.progress(its, display("s", [0.1]), "dispersion", CRITERIA.quantities[1], 0.262)
    for text in ("dispersion [ms]", "of the best [ms]", "bullet-300", "yade-1000", "R1", "R2",
                 "failed runs", "physical lower bound"):  # fmt: skip
        assert text in svg


def test_progress_of_one_generation_and_of_negative_values_draws() -> None:
    assert "<svg" in charts.progress([step(1, "a", best=-3.0)], display("-", [1.0]), "f", None)


def test_progress_over_decades_is_logarithmic() -> None:
    decades = [step(n, "a", best=10.0**-n) for n in range(1, 5)]
    flat = [step(n, "a", best=1.0 + 0.1 * n) for n in range(1, 5)]
    logarithmic, linear = (
        charts.progress(s, display("-", [1.0]), "f", None) for s in (decades, flat)
    )
    assert ">0.001<" in logarithmic
    assert ">0.001<" not in linear


def test_motion_and_passages_carry_units(machine: Callable[[Array], DesignView]) -> None:
    view = machine(np.full(13, 0.2))
    motion = charts.motion(view, None)
    for text in ("cup position [mm]", "cup velocity [m/s]", "[ms]", "P1", "P2"):
        assert text in motion
    passages = charts.passages([np.linspace(0.2, 0.5, 50)], [], "the start of the run")
    for text in ("grains passed [%]", "rate [grains/s]", "best (1 run)"):
        assert text in passages
    assert "baseline" not in passages


def test_figures_repeat_bit_for_bit() -> None:
    its = [step(n, "a") for n in range(1, 4)]
    first, second = (charts.progress(its, display("-", [1.0]), "f", None) for _ in range(2))
    assert first == second


def test_a_stretch_that_begins_at_nothing_is_named_on_a_logarithmic_axis() -> None:
    axes = Figure().subplots()
    axes.set_xscale("log")
    axes.set_xlim(0.01, 10.0)
    charts.draw_bands([axes], [("coarse", 0.0, 1.0), ("fine", 1.0, 10.0)])
    assert [label.get_text() for label in axes.texts] == ["coarse", "fine"]
    assert [label.xy[0] for label in axes.texts] == pytest.approx([0.0, 2 / 3])


def test_a_legend_covers_no_data_and_intervals_are_not_clipped(
    make_assisted: Callable[..., RunDirectory],
) -> None:
    facts = gather(make_assisted())
    assert facts.course is not None
    figures: list[Figure] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(course_chart, "as_svg", lambda figure: figures.append(figure) or "")
        course_chart.course(facts.course, facts.shown, facts.name, None)
    (figure,) = figures
    figure.draw_without_rendering()
    (legend,) = figure.legends
    top = legend.get_window_extent().y1
    assert all(top <= axis.get_window_extent().y0 for axis in figure.axes)
    low, high = figure.axes[0].get_ylim()
    for look in facts.course.looks:
        assert look.insight is not None
        ends = [end * facts.shown.factor for end in look.insight.interval]
        assert low <= min(ends) <= max(ends) <= high


def test_no_label_reaches_beyond_the_sides_of_a_figure() -> None:
    with charts.styled():
        figure, (axis,) = charts.panels_over_time(2.0, 1)
        axis.plot([0.0, 2.0], [-1e2, 1e2])
        axis.set_xlim(0.0, 2.0)
        axis.set_ylabel("two lines of a label\nbeside long ticks")
        axis.set_yticks([0.0], ["a long word at a tick"])
        assert figure.get_tightbbox().x0 < 0.0
        assert figure.get_tightbbox().x1 > charts.WIDTH
        charts.keep_inside(figure)
        drawn = figure.get_tightbbox()
    assert drawn.x0 >= 0.0
    assert drawn.x1 <= charts.WIDTH
