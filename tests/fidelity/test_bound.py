import numpy as np
import pytest

from fidelity.scenes.dosing.bound import (
    emptying_spread,
    filling_time_bound,
    largest_speed,
    opened_area,
    smallest_filling_time_bound,
)
from fidelity.scenes.dosing.design import design, dosing_problem
from fidelity.scenes.dosing.settings import MOTION_PARAMETERS, SIMPLE_MOTIONS, DosingSettings
from geometry.parts import Cup
from geometry.sections import Section

SETTINGS = DosingSettings()
CUP = Section(0.130, 0.100, 0.020, 0.0)
HOLE = Section(0.150, 0.115, 0.025, 0.0)


TIMES = np.linspace(0.0, 0.6, 60001)


def test_an_opening_as_large_as_the_cup_lets_the_column_fall_whole() -> None:
    # Without corners cup and opening are alike, and 0.5 g t^2 holds for both ends of the column.
    square = Cup(Section(0.130, 0.100, 1e-9, 0.0), 1279e-6)
    areas = np.full(TIMES.shape, 0.130 * 0.100)
    spread = emptying_spread(TIMES, areas, square, 0.56)
    t_low = np.sqrt(2 * 0.56 / 9.81)
    assert 9.81 / 2 * (t_low + spread) ** 2 == pytest.approx(0.56 + square.height, rel=1e-3)


def test_half_the_area_takes_longer_and_none_for_ever() -> None:
    cup = Cup(CUP, 1279e-6)
    spreads = [emptying_spread(TIMES, np.full(TIMES.shape, a), cup, 0.56) for a in (0.013, 0.0065)]
    assert spreads[0] < spreads[1] < np.inf
    assert emptying_spread(TIMES, np.zeros(TIMES.shape), cup, 0.56) == np.inf


def test_opened_area_is_that_of_two_overlapping_rectangles() -> None:
    # Apart, touching, half of the cup in, and wholly over the hole.
    areas = opened_area(np.array([-0.3, -0.140, -0.075, 0.0]), CUP, HOLE)
    np.testing.assert_allclose(areas, [0.0, 0.0, 0.065 * 0.1, 0.13 * 0.1], atol=1e-15)


def test_a_slower_cup_has_the_larger_bound() -> None:
    cup = Cup(CUP, 1279e-6)
    times = np.linspace(0.0, 2.0, 20001)
    spreads = [
        emptying_spread(times, opened_area(-0.2 + v * times, CUP, HOLE), cup, 0.56)
        for v in (1.0, 0.5, 0.25)
    ]
    assert spreads[0] < spreads[1] < spreads[2]


def test_bound_over_all_motions_is_below_that_of_any_design() -> None:
    problem, rng = dosing_problem(SETTINGS), np.random.default_rng(3)
    smallest = smallest_filling_time_bound(SETTINGS)
    bounds = [
        filling_time_bound(design(SETTINGS, x))
        for x in problem.to_x(rng.random((60, problem.dimension)))
        if problem.impossible(x) is None
    ]
    assert len(bounds) > 20
    assert 0 < smallest <= min(bounds)


def test_largest_speed_is_that_of_the_only_motion_if_none_is_free() -> None:
    constant = dict(zip(MOTION_PARAMETERS, SIMPLE_MOTIONS["constant"], strict=True))
    fixed = DosingSettings(free={"l1": (80, 180)}, values=constant)
    assert largest_speed(fixed) == pytest.approx(1.0, rel=1e-9)
