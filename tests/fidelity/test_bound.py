import numpy as np
import pytest

from fidelity.bound import (
    falling_spread,
    filling_time_bound,
    largest_speed,
    opening_time,
    smallest_filling_time_bound,
)
from fidelity.dosing import design, dosing_problem
from fidelity.settings import DosingSettings
from geometry.sections import Section

SETTINGS = DosingSettings()
CUP = Section(0.130, 0.100, 0.020, 0.0)
HOLE = Section(0.150, 0.115, 0.025, 0.0)


def test_a_column_spreads_as_its_ends_fall() -> None:
    # 0.5 g t^2 for both ends.
    spread, t_low = falling_spread(0.56, 0.1), np.sqrt(2 * 0.56 / 9.81)
    assert 9.81 / 2 * (t_low + spread) ** 2 == pytest.approx(0.66, rel=1e-12)


def test_opening_lasts_as_long_as_the_cup_takes_for_its_own_length() -> None:
    times = np.linspace(0.0, 0.6, 6001)
    speed = 0.4 / 0.6
    assert opening_time(-0.2 + speed * times, times, CUP, HOLE) == pytest.approx(
        0.130 / speed, abs=2e-4
    )


def test_no_opening_without_overlap() -> None:
    times = np.linspace(0.0, 0.6, 61)
    assert opening_time(np.full(61, -0.3), times, CUP, HOLE) == 0.0


def test_bound_of_the_baseline_is_opening_plus_fall() -> None:
    machine = design(SETTINGS, dosing_problem(SETTINGS).baseline)
    expected = 0.130 / (0.4 / 0.6) + falling_spread(0.56, machine.cup.height)
    assert filling_time_bound(machine) == pytest.approx(expected, abs=1e-3)


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
    fixed = DosingSettings(free={"l1": (80, 180)})
    assert largest_speed(fixed) == pytest.approx(1.0, rel=1e-9)
