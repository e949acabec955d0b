"""The result in words."""

import numpy as np
import pytest

from reports.result import Result
from reports.rows import Row
from reports.sentence import against, at_bounds, chosen, interval_text, sentence, state
from reports.statistics import Comparison, Interval
from reports.units import Display

MS = Display(1e3, "ms")


@pytest.mark.parametrize(
    ("best", "words"), [(0.06, "40.0\u202f% below"), (0.11, "10.0\u202f% above")]
)
def test_a_worse_design_is_not_called_better(best: float, words: str) -> None:
    text = against(Comparison((1,), np.array([best]), np.array([0.1])), MS)
    assert text == f"{words} the baseline's 100.0\u202fms"


def test_without_a_percentage_the_baseline_is_still_named() -> None:
    text = against(Comparison((1,), np.array([-1.0]), np.array([0.0])), Display(1.0, "kg"))
    assert text == "against 0\u202fkg of the baseline"


def test_a_run_without_a_result_says_so() -> None:
    assert sentence(None, [], "f", MS, ended=False) == "Nothing has run yet."
    assert state("done", []) is None
    assert "has not ended" in str(state(None, []))


def test_intervals_and_bounds_in_words() -> None:
    assert interval_text(Interval(0.061, 0.066, 0.9375), MS) == "61.00 to 66.00\u202fms"
    assert interval_text(None, MS) == "one seed gives no interval"
    assert [at_bounds(s) for s in (0.0, 0.5, 1.0)] == [
        "at its lower bound",
        "",
        "at its upper bound",
    ]


def test_finalists_are_told_where_there_were_any() -> None:
    x = np.zeros(1)
    run = Row(0, 1, "fine", 1, "search", x, 0.1, {}, "finished", None, 1.0, 1.0)
    its = Result(run, (), (), None, {})
    assert "promising" not in chosen(its, method="assisted", insights=True)
    text = chosen(its, method="assisted", insights=True, finalists=3)
    assert "Then the 3 most promising designs were run at the target level" in text


@pytest.mark.parametrize(("best", "keep"), [(0.06, False), (0.1, True), (0.11, True)])
def test_where_nothing_better_was_found_the_baseline_is_to_be_kept(best: float, keep: bool) -> None:
    x = np.zeros(1)
    run = Row(0, 1, "fine", 1, "search", x, best, {}, "finished", None, 1.0, 1.0)
    compared = Comparison((1,), np.array([best]), np.array([0.1]))
    its = Result(run, (run,), (), compared, {})
    text = sentence(its, [run], "objective", MS, ended=True)
    assert text.startswith("No better design was found: keep the baseline. ") == keep
