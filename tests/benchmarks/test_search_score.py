"""Costs to a target, on traces made by hand."""

import math
from pathlib import Path

import numpy as np
import pytest

from benchmarks.search.case import Trace
from benchmarks.search.report import report
from benchmarks.search.results import (
    Result,
    append,
    done,
    hit,
    kind_of,
    left_on_the_way,
    read,
    result_file,
    scored,
)
from benchmarks.search.score import (
    compare,
    expected_running_time,
    geometric_mean,
    mean_and_error,
    paired,
    share,
)


def _trace(*entries: tuple[float, int], cost: float = 100.0) -> Trace:
    costs, cells = zip((0.0, 0), *entries, strict=True)
    return Trace(costs, cells, (0,) * len(costs), (int(cost),), cost)


def _results(peer: str, traces: list[Trace], case: str = "bbob/f1/d10") -> list[Result]:
    return [scored(peer, case, 101 + i, 100.0, t, (20, 40, 60, 80)) for i, t in enumerate(traces)]


def test_a_hit_must_last() -> None:
    assert hit(_trace((10, 25)), 20) == 10
    assert hit(_trace((10, 25), (50, 5)), 20) is None
    assert hit(_trace((10, 25), (50, 5), (70, 30), (80, 22)), 20) == 70
    assert hit(_trace((10, 19)), 20) is None


def test_failures_are_paid_for() -> None:
    traces = [_trace((10, 25)), _trace((30, 25)), _trace(cost=60.0), _trace((5, 25), (6, 3))]
    results = _results("mfopt", traces)
    assert expected_running_time(results, 20) == (10 + 30 + 60 + 100) / 2
    assert expected_running_time(results[2:], 20) == math.inf


def test_the_ratio_is_of_expected_running_times_over_common_instances() -> None:
    ours = _results("mfopt", [_trace((10, 25)), _trace((20, 25))])
    theirs = _results("pycma", [_trace((30, 25)), _trace((60, 25)), _trace((1, 25))])
    summary = compare(ours, {"pycma": theirs}, [20])
    assert summary.centre == pytest.approx(3.0)
    assert summary.low <= 3.0 <= summary.high
    assert summary.ratios[0].instances == 2
    assert not summary.lost


def test_the_geometric_mean_limits_what_only_one_reached() -> None:
    ratios = np.array([[4.0, 1.0], [1.0, np.inf], [2.0, 0.0]])
    np.testing.assert_allclose(geometric_mean(ratios), [2.0, 1.0])


def test_what_is_left_on_the_way_is_an_average_over_the_logarithm_of_the_cost() -> None:
    # nothing gained up to a cost of 10 of 100, from there on one decade, beyond it does not count
    trace = _trace((10, 20), (50, 90))
    share_of_way = math.log(100 / 10) / math.log(40)
    assert left_on_the_way(trace, 100.0, 20) == pytest.approx(-share_of_way, abs=0.02)


def test_runs_are_paired_by_case_and_instance() -> None:
    ours = _results("mfopt", [_trace((1, 20)), _trace((1, 40)), _trace((1, 30))])
    theirs = _results("pycma", [_trace((1, 30)), _trace((1, 30))])
    differences = paired(ours, theirs)
    np.testing.assert_allclose(differences, [0.5, -0.5])
    assert mean_and_error(differences) == "+0.00 ± 0.50"


def test_lost_and_unreached_cases_are_named() -> None:
    ours = _results("mfopt", [_trace((50, 25))] * 3)
    theirs = _results("pycma", [_trace((10, 45))] * 3)
    summary = compare(ours, {"pycma": theirs}, [20, 40, 60])
    assert [(r.target, r.ratio) for r in summary.lost] == [(40, 0.0), (20, pytest.approx(0.2))]
    assert summary.unreached == (("bbob/f1/d10", 60),)


def test_a_case_that_only_one_has_run_is_left_out() -> None:
    ours = _results("mfopt", [_trace((50, 25))]) + _results("mfopt", [_trace()], "wing")
    theirs = _results("pycma", [_trace((10, 25))])
    summary = compare(ours, {"pycma": theirs}, [20], cases=["bbob/f1/d10", "wing", "bbob/f2/d10"])
    assert len(summary.ratios) == 1
    assert summary.unreached == ()


def test_the_best_peer_is_taken_case_by_case() -> None:
    ours = _results("mfopt", [_trace((10, 45))] * 2)
    quick = _results("a", [_trace((20, 25))] * 2)  # best at 10 %, never at 1 %
    slow = _results("b", [_trace((40, 45))] * 2)
    summary = compare(ours, {"a": quick, "b": slow}, [20, 40])
    assert [(r.other, r.ratio) for r in summary.ratios] == [("a", 2.0), ("b", 4.0)]


def test_intervals_widen_with_the_scatter() -> None:
    theirs = _results("pycma", [_trace((40, 25))] * 10)
    even = compare(_results("m", [_trace((20, 25))] * 10), {"p": theirs}, [20])
    odd = compare(_results("m", [_trace((c, 25)) for c in range(2, 40, 4)]), {"p": theirs}, [20])
    assert even.high - even.low == pytest.approx(0.0)
    assert odd.high - odd.low > 0.5


def test_one_instance_with_two_budgets_is_refused() -> None:
    rows = _results("m", [_trace((1, 25))])
    with pytest.raises(ValueError, match="twice"):
        compare(rows + rows, {"p": rows}, [20])


def test_targets_in_words() -> None:
    assert [share(k) for k in (20, 30, 40, 60, 80)] == ["10 %", "3.2 %", "1 %", "0.1 %", "1e-04"]


def test_results_survive_a_torn_line(tmp_path: Path) -> None:
    path = result_file(tmp_path, "noise-free", "pycma", 101)
    first, second = _results("pycma", [_trace((10, 25)), _trace((12.5, 30))])
    append(path, first)
    with path.open("a") as file:
        file.write('{"case":"bbob/f1')
    append(path, second)
    assert list(read(path)) == [first, second]
    assert done(read(path)) == {("bbob/f1/d10", 101, 100.0), ("bbob/f1/d10", 102, 100.0)}


def test_tuning_and_reported_instances_are_kept_apart(tmp_path: Path) -> None:
    assert [kind_of(i) for i in (1, 20, 101, 115)] == ["tuning", "tuning", "reported", "reported"]
    with pytest.raises(ValueError, match="neither"):
        kind_of(21)


def test_the_report_names_what_is_lost_and_what_was_not_run(tmp_path: Path) -> None:
    for peer, cost in (("mfopt-x", 50), ("pycma", 10)):
        for result in _results(peer, [_trace((cost, 85))] * 3):
            append(result_file(tmp_path, "noise-free", peer, result.instance), result)
    text, summaries = report(tmp_path, "mfopt-x", "reported")
    assert "| bbob/f1/d10 | 10 % | 0.20 (0.20 to 0.20) | 3, 3 of 3 | pycma |" in text
    assert text.count("not run") == 5
    assert len(summaries) == 1


def test_one_instance_gives_no_interval(tmp_path: Path) -> None:
    for peer, cost in (("mfopt-x", 50), ("pycma", 10)):
        (result,) = _results(peer, [_trace((cost, 85))])
        append(result_file(tmp_path, "noise-free", peer, result.instance), result)
    text, _ = report(tmp_path, "mfopt-x", "reported")
    assert "| bbob/f1/d10 | 10 % | 0.20 | 1, 1 of 1 | pycma |" in text
