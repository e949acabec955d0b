"""What a calibration says: warnings first, trade-offs, ends of ranges, check of the emulators."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from calibration.summary import edge_of
from calibration.words import (
    STRONG,
    check_in_words,
    combinations,
    further,
    in_words,
    parameter_in_words,
    trade_offs,
    warnings,
)
from mfopt.records.calibration import (
    Advice,
    Compared,
    Direction,
    EmulatorCheck,
    Found,
    LeftOut,
    Offset,
    Summary,
    chance,
)


def found(name: str, **changed: Any) -> Found:
    its = Found(
        name, "-", 0.0, 0.8, 0.36, 0.37, (0.33, 0.41), 0.13, determined=True, asked=True,
        log=False, edge=None,
    )  # fmt: skip
    return replace(its, **changed)


def check(*, fresh: bool, squared: float = 0.9, error: float = 0.8) -> EmulatorCheck:
    held = 0.92 if squared < 1.5 else 0.6
    return EmulatorCheck("slot", fresh, 6, held, squared, 1.5, error)


def compared(error: float, *, held_out: bool = False) -> Compared:
    return Compared("slot", held_out, "level", "m", None, [1.0], [1.1], [0.9], [1.2], [0.1], error)


def summary(**changed: Any) -> Summary:
    its = Summary(
        name="beads", parameters=(found("linear"), found("quadratic")), directions=(),
        combinations=[], trade_offs=[], correlation=[[1.0, 0.1], [0.1, 1.0]], draws=[],
        log_evidence=0.0, misfit=20.0, freedom=20, probability=0.5, fits=True, recordings=(),
        compared=(compared(1.0),), noise=(), runs=80, failed=0, cpu_s=1.0,
        emulators=(check(fresh=False), check(fresh=True)), without=(), advice=(), further=[],
        warnings=[],
        check=[], words=[],
    )  # fmt: skip
    return replace(its, **changed)


def test_a_right_fit_has_no_warnings_and_one_line_on_the_emulators() -> None:
    assert warnings(summary()) == []
    assert check_in_words(summary()) == [
        "The emulators know their errors: of their 90 % intervals 92 % hold runs left out of the "
        "fit, 92 % hold fresh runs"
    ]


def test_a_wrong_model_is_said_first_and_marks_every_value() -> None:
    its = summary(fits=False, probability=1e-9, misfit=753.0)
    its = replace(its, warnings=warnings(its))
    first, *rest = in_words(its)
    assert first.startswith("The simulation does not fit: a misfit of 753 on 20 degrees")
    assert "has the probability below 0.001. The values are those of a wrong model." in first
    lines = [line for line in rest if " = " in line]
    assert len(lines) == 2
    assert all("of a wrong model" in line for line in lines)


def test_probabilities_near_0_and_1_are_only_said_to_be_so() -> None:
    its = [chance(p) for p in (1e-9, 0.0012, 0.5, 0.9999)]
    assert its == ["below 0.001", "0.0012", "0.50", "above 0.99"]


def test_a_fitted_recording_that_is_far_off_is_named() -> None:
    its = summary(fits=False, compared=(compared(1.0), compared(3.4), compared(9.0, held_out=True)))
    (line,) = warnings(its)
    assert "slot, level, is 3.4 times as far from the simulation" in line
    assert line.startswith("The simulation does not fit: a misfit of 20")


def test_values_of_a_right_model_carry_no_warning() -> None:
    assert parameter_in_words(found("friction"), fits=True) == (
        "friction = 0.37, 90 % from 0.33 to 0.41"
    )


@pytest.mark.parametrize(("r", "way"), [(-0.95, "smaller"), (0.95, "larger")])
def test_parameters_that_trade_off_are_named_though_both_are_determined(r: float, way: str) -> None:
    (line,) = trade_offs(summary(correlation=[[1.0, r], [r, 1.0]]))
    assert line.startswith(f"linear and quadratic trade off (correlation {r:.2f})")
    assert f"a larger linear with a {way} quadratic" in line
    assert "shrink to 31 %" in line


def test_a_correlation_that_leaves_more_than_half_of_an_interval_is_no_trade_off() -> None:
    weak, strong = STRONG - 0.01, STRONG + 0.01
    assert trade_offs(summary(correlation=[[1.0, weak], [weak, 1.0]])) == []
    assert len(trade_offs(summary(correlation=[[1.0, strong], [strong, 1.0]]))) == 1


def test_draws_at_an_end_of_the_range_are_found() -> None:
    rng = np.random.default_rng(1)
    piled = np.minimum(rng.exponential(0.02, 2000), 1.0)
    assert edge_of(piled) == "lower"
    assert edge_of(1.0 - piled) == "upper"
    assert edge_of(np.full(2000, 1.0)) == "upper"


def test_draws_that_the_bound_does_not_cut_off_are_not_at_the_edge() -> None:
    rng = np.random.default_rng(2)
    assert edge_of(rng.random(2000)) is None  # nothing was learnt
    assert edge_of(0.03 + 0.004 * rng.normal(size=2000)) is None  # small, and well determined
    assert edge_of(0.5 + 0.1 * rng.normal(size=2000)) is None


def test_an_end_of_the_range_comes_with_a_remedy() -> None:
    (upper,) = warnings(summary(parameters=(found("friction", edge="upper"),)))
    assert upper.startswith("friction lies at the upper end of its range, 0.8: widen the range")
    (none,) = warnings(summary(parameters=(found("dry", edge="lower"),)))
    assert "no sign of it" in none
    wrong = summary(parameters=(found("dry", edge="lower"),), fits=False, probability=1e-9)
    first, second = warnings(wrong)
    assert "First widen the range of dry" in first
    assert "add the physics" not in first
    assert "the simulation lacks something" in second
    inside = summary(fits=False, probability=1e-9)
    assert "or add the physics that the simulation lacks" in warnings(inside)[0]
    along = found("young_modulus", unit="Pa", high=1.2e7, asked=False, edge="upper")
    (line,) = warnings(summary(parameters=(along,)))
    assert "1.2e+07 Pa: what the case states of it may be wrong" in line


@pytest.mark.parametrize("fresh", [False, True])
def test_an_emulator_that_is_too_sure_is_named_with_the_remedy(fresh: bool) -> None:
    its = summary(emulators=(check(fresh=not fresh), check(fresh=fresh, squared=2.3)))
    (line,) = warnings(its)
    assert ("fresh runs" in line) is fresh
    assert "60 % of its 90 % intervals" in line
    assert "--runs 160" in line
    assert check_in_words(its) == []


def test_an_emulator_that_is_coarse_near_the_result_is_named_and_far_from_it_is_not() -> None:
    far = summary(emulators=(check(fresh=False, error=5.8), check(fresh=True)))
    assert len(check_in_words(far)) == 1
    near = summary(emulators=(check(fresh=False), check(fresh=True, error=1.8)))
    _, line = check_in_words(near)
    assert line.startswith("The emulator of slot is coarse: near the result it allows for an error")
    assert "and has one of 1.8" in line
    assert "--runs 160" in line
    # Far too unsure: it errs little, and the intervals are wide for nothing.
    unsure = summary(emulators=(check(fresh=False), check(fresh=True, error=0.3, squared=0.01)))
    assert "allows for an error of 3.0 times" in check_in_words(unsure)[1]


def test_the_recording_that_tells_most_is_said() -> None:
    its = summary(
        parameters=(found("linear"), found("quadratic", determined=False)),
        advice=(Advice("a", {"linear": 0.9, "quadratic": 0.8}, 0),
                Advice("b", {"linear": 0.9, "quadratic": 0.4}, 0)),
    )  # fmt: skip
    assert further(its) == [
        "To determine quadratic, record next: b; its interval would shrink to 40 %"
    ]
    (line,) = further(replace(its, advice=()))
    assert line == "Which further recording would determine them: mfopt calibrate with --advise"
    (line,) = further(replace(its, advice=()), possible=False)
    assert "name experiments in tables [[possible]] of the case file, then mfopt calibrate" in line


def test_a_fit_without_an_error_says_how_much_narrower_intervals_are() -> None:
    its = summary(
        without=(LeftOut("clock", {"linear": (0.35, 0.39), "quadratic": (0.3, 0.42)}, 50.0),)
    )
    line = next(line for line in in_words(its) if "Without" in line)
    assert line == (
        "Without the error clock: linear 0.35 to 0.39, 50 % as wide; quadratic 0.3 to 0.42, "
        "150 % as wide; misfit 50 instead of 20 on 20 degrees of freedom"
    )


def test_an_error_of_the_zero_is_said_if_it_is_larger_than_stated() -> None:
    right = Offset("slot", "zero of level", "m", 0.001, 0.0008, 0.0003)
    off = Offset("slot", "zero of level", "m", 0.001, -0.00153, 0.0003)
    unseen = Offset("slot", "scale of level", "-", 0.001, 0.002, 0.0015)
    lines = [x for x in in_words(summary(offsets=(right, off, unseen))) if "found off" in x]
    assert lines == [
        "slot: the zero of level was found off by -0.0015 m (1 sd 0.0003 m), more than the stated "
        "0.001 m"
    ]


def test_a_wrong_model_gives_no_advice() -> None:
    advice = (Advice("a", {"linear": 0.3, "quadratic": 0.4}, 0),)
    its = summary(parameters=(found("linear", determined=False),), advice=advice)
    assert "record next: a" in further(its)[0]
    assert "first make the simulation fit" in further(replace(its, fits=False))[0]


def test_few_different_draws_make_no_separate_values() -> None:
    draws = np.repeat([[-0.7], [0.1], [0.6], [0.7]], 125, axis=0).tolist()
    its = summary(parameters=(found("swing", interval=(-0.7, 0.7)),), draws=draws)
    assert warnings(its) == []


def test_separate_values_of_a_parameter_are_named() -> None:
    # A parameter that enters as its square: nothing tells +0.7 from -0.7.
    rng = np.random.default_rng(1)
    square = rng.choice([-0.7, 0.7], 500) + 0.05 * rng.standard_normal(500)
    low, high = np.quantile(square, [0.05, 0.95])
    draws = np.column_stack([square, rng.standard_normal(500)]).tolist()
    two = found("swing", interval=(float(low), float(high)))
    one = found("drag", interval=(-1.645, 1.645))
    (line,) = warnings(summary(parameters=(two, one), draws=draws))
    assert line.startswith("swing has separate values, -0.7")
    assert "the mean too, does not fit" in line


def test_many_failed_runs_are_a_warning() -> None:
    (line,) = warnings(summary(failed=17))
    assert line.startswith("17 of 80 simulations failed")
    assert warnings(summary(failed=16)) == []


def test_draws_at_a_bound_are_not_said_to_be_two_values() -> None:
    draws = np.repeat([[0.79, 0.3], [0.8, 0.31]], 50, axis=0).tolist()
    edge = found("rate", interval=(0.79, 0.8), edge="upper")
    (line,) = warnings(summary(parameters=(edge, found("drag", interval=(0.1, 0.6))), draws=draws))
    assert line.startswith("rate lies at the upper end")


def test_advice_is_said_of_determined_parameters_and_of_runs_that_failed() -> None:
    advice = (
        Advice("a", {"linear": 0.5, "quadratic": 0.9}, 0),
        Advice("b", {"linear": 1.0, "quadratic": 1.0}, 24),
    )
    assert further(summary(advice=advice)) == [
        "Of the further recording b nothing is known: 24 of its simulations failed",
        "To narrow linear, record next: a; its interval would shrink to 50 %",
        "None of the 2 further recordings tells quadratic better",
    ]


def test_a_combination_is_named_from_its_first_parameter_and_only_where_parameters_correlate() -> (
    None
):
    lost = (found("linear", determined=False), found("quadratic", determined=False))
    along = Direction({"linear": -0.7, "quadratic": -0.7}, 0.9)
    across = Direction({"linear": -0.7, "quadratic": 0.7}, 0.1)
    ridge = summary(
        parameters=lost, directions=(across, along), correlation=[[1.0, 0.8], [0.8, 1.0]]
    )
    assert combinations(ridge) == [
        "The combination linear - quadratic is determined",
        "The combination linear + quadratic is not determined: it can change without a visible "
        "difference",
    ]
    assert combinations(replace(ridge, correlation=[[1.0, 0.3], [0.3, 1.0]])) == []
