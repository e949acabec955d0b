"""The cases that searches are compared on, and the meter."""

import numpy as np
import pytest
from cma import bbobbenchmarks

from benchmarks.search.case import LAST_CELL, Case, Meter, Spent, cell_of
from benchmarks.search.functions import bbob_noise
from benchmarks.search.suites import SUITES, case_named, default_budget

ALL = [name for names in SUITES.values() for name in names]


@pytest.mark.parametrize("name", ALL)
def test_nothing_is_below_the_optimum(name: str) -> None:
    case = case_named(name, 101)
    x = case.to_x(np.random.default_rng(1).random((2000, case.dimension)))
    assert np.min(case.levels[-1](x)) > case.optimum
    assert case.gap(case.x0) > 0.0
    assert len(case.costs) == len(case.levels)
    assert list(case.costs) == sorted(case.costs)


@pytest.mark.parametrize("number", [1, 6, 9, 10, 13, 15, 21, 107, 116, 119])
def test_the_optimum_is_reached(number: int) -> None:
    name = f"bbob/f{number}/d13" if number < 100 else f"noisy/f{number}/d13"
    case = case_named(name, 102)
    function = bbobbenchmarks.dictbbob[number](iinstance=102)
    function(np.zeros(13))
    assert case.gap(np.asarray(function.xopt)) == pytest.approx(0.0, abs=1e-8)


def test_the_wing_is_lightest_where_the_formula_is_monotone() -> None:
    case = case_named("wing", 101)
    best = np.array([150.0, 220.0, 6.0, 0.0, 16.0, 0.5, 0.18, 2.5, 1700.0, 0.025])
    assert case.gap(best) == 0.0
    for i in range(10):
        for side in (case.lower, case.upper):
            moved = best.copy()
            moved[i] = side[i]
            assert case.gap(moved) >= 0.0


def test_instances_differ_and_repeat() -> None:
    first, again = (case_named.__wrapped__("ladder/f10/b1/n30", 101) for _ in range(2))
    other = case_named("ladder/f10/b1/n30", 102)
    x = first.x0
    for level in range(3):
        assert first.levels[level](x) == again.levels[level](x)
        assert first.levels[level](x) != other.levels[level](x)


@pytest.mark.parametrize("name", [n for n in ALL if case_named(n, 101).noisy])
def test_noise_is_of_the_generator_alone(name: str) -> None:
    case = case_named(name, 101)
    first, again, other = (
        [case.evaluate(case.x0, case.target, rng) for _ in range(5)]
        for rng in map(np.random.default_rng, (3, 3, 4))
    )
    assert first == again
    if name != "noisy/f118/d13":  # seldom Cauchy: mostly constant
        assert first != other


def test_simple_noise_has_the_size_that_its_name_says() -> None:
    rng = np.random.default_rng(1)
    case = case_named("ladder/f1/b1/n30", 101)
    values = [case.evaluate(case.x0, 2, rng) - case.optimum for _ in range(4000)]
    assert np.std(values) == pytest.approx(0.3 * case.gap(case.x0), rel=0.05)
    case = case_named("ladder/f1/b1/n5", 101)
    points = np.random.default_rng(7).uniform(-5.0, 5.0, (1000, 13))
    scale = np.median(case.levels[-1](points)) - case.optimum
    values = [case.evaluate(case.x0, 2, rng) for _ in range(4000)]
    assert np.std(values) == pytest.approx(0.05 * scale, rel=0.05)


@pytest.mark.parametrize("number", [107, 108, 109])
def test_bbob_noise_is_distributed_as_the_library_draws_it(number: int) -> None:
    function = bbobbenchmarks.dictbbob[number](iinstance=1)
    x = np.zeros(13)
    np.random.seed(5)  # noqa: NPY002 - the library draws from numpy's global generator
    theirs = [float(function._evalfull(x)[0]) - function.fopt for _ in range(4000)]
    true = float(function._evalfull(x)[1]) - function.fopt
    noise, rng = bbob_noise(number, 13), np.random.default_rng(5)
    ours = [noise(true, rng) for _ in range(4000)]
    for q in (0.1, 0.25, 0.5, 0.75):
        assert np.quantile(ours, q) == pytest.approx(np.quantile(theirs, q), rel=0.12)


def test_a_stronger_bias_moves_the_coarse_levels_further_from_the_target() -> None:
    x = case_named("ladder/f1/b1/n0", 101).to_x(np.random.default_rng(2).random((500, 13)))

    def error(bias: str, level: int) -> float:
        case = case_named(f"ladder/f1/b{bias}/n0", 101)
        return float(np.std(case.levels[level](x) - case.levels[2](x)))

    assert error("1", 0) > error("1", 1) > 0.0
    assert error("1", 0) > 2.0 * error("0.3", 0)


def test_bad_levels_do_not_rank_as_the_target_does() -> None:
    rng = np.random.default_rng(3)
    for kind, lowest, highest in (("useless", -0.4, 0.4), ("opposed", -1.0, -0.9)):
        case = case_named(f"bad/f10/{kind}", 101)
        x = case.to_x(rng.random((1000, 13)))
        for level in (0, 1):
            r = np.corrcoef(case.levels[level](x), case.levels[2](x))[0, 1]
            assert lowest <= r <= highest


def test_unknown_cases_are_refused() -> None:
    for name in ("bbob/f99/d13", "ladder/f10/b1/n7", "bad/f1/odd", "nothing", "bbob/f1"):
        with pytest.raises(ValueError, match="no case"):
            case_named(name, 1)


def _bowl() -> Case:
    return Case(
        "bowl", 101, np.zeros(2), np.ones(2), np.ones(2),
        (lambda x: (x * x).sum(-1) + 0.1, lambda x: (x * x).sum(-1)), (1.0, 8.0), 0.0,
    )  # fmt: skip


def test_the_meter_counts_every_level_and_stops_before_the_budget_is_exceeded() -> None:
    meter = Meter(_bowl(), 18.0, 1, follow_best=True)
    meter([0.5, 0.5], 0)
    meter([0.4, 0.4])
    meter([0.3, 0.3])
    with pytest.raises(Spent, match="budget"):
        meter([0.2, 0.2])
    trace = meter.trace()
    assert trace.cost == 17.0
    assert trace.runs == (1, 2)


def test_the_meter_follows_the_best_of_the_highest_level() -> None:
    meter = Meter(_bowl(), 100.0, 1, follow_best=True)
    meter([0.1, 0.1], 0)
    meter([0.5, 0.5], 1)  # a higher level replaces what the lower one found
    meter([0.0, 0.0], 0)  # and the lower one has no say any more
    meter([0.01, 0.01], 1, audit=True)
    assert meter.trace().cells == (0, cell_of(0.01), cell_of(0.25))


def test_cells_hold_the_targets_exactly() -> None:
    assert cell_of(1.0) == 0
    assert cell_of(0.1) == 20
    assert cell_of(0.1 + 1e-6) == 19
    assert cell_of(0.01) == 40
    assert cell_of(0.0) == LAST_CELL
    assert cell_of(1e9) == -20


def test_budgets() -> None:
    assert default_budget(case_named("bbob/f1/d13", 1)) == 780
    assert default_budget(case_named("noisy/f107/d13", 1)) == 600
    assert default_budget(case_named("wing", 1)) == 40 * 1000
    assert default_budget(case_named("bad/f1/useless", 1)) == 200 * 64
