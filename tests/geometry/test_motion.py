"""The motion law: ends, continuity, derivatives, range."""

import numpy as np
import pytest

from geometry.motion import MotionLaw
from mfopt.errors import ConfigError, InvalidDesign

LAWS = [
    MotionLaw(0.3, 0.45, 0.7, 0.6, 1.2),
    MotionLaw(0.05, 0.9, 0.95, 0.1, 4.0),  # moves back
    MotionLaw(0.45, 0.1, 0.55, 0.9, 0.2),
]


@pytest.mark.parametrize("law", LAWS)
def test_law_passes_through_its_points_and_is_smooth(law: MotionLaw) -> None:
    assert law.position(np.array([0.0, law.x1, law.x2, 1.0])) == pytest.approx(
        [0.0, law.y1, law.y2, 1.0], abs=1e-12
    )
    assert law.velocity(0.0) == pytest.approx(law.v)
    assert law.velocity(1.0) == pytest.approx(law.v)
    slope = (law.y2 - law.y1) / (law.x2 - law.x1)
    for point in (law.x1, law.x2):
        for t in (point - 1e-9, point, point + 1e-9):
            assert law.velocity(t) == pytest.approx(slope, abs=1e-4)


@pytest.mark.parametrize("law", LAWS)
def test_velocity_and_acceleration_are_the_derivatives(law: MotionLaw) -> None:
    t = np.setdiff1d(np.linspace(0.01, 0.99, 197).round(6), [law.x1, law.x2])
    step = 1e-6
    speed = (law.position(t + step) - law.position(t - step)) / (2 * step)
    thrust = (law.velocity(t + step) - law.velocity(t - step)) / (2 * step)
    assert law.velocity(t) == pytest.approx(speed, abs=1e-5)
    assert law.acceleration(t) == pytest.approx(thrust, abs=1e-4)


def test_line_has_constant_velocity_and_the_jump_belongs_to_the_later_piece() -> None:
    law = LAWS[0]
    assert np.all(law.acceleration(np.linspace(0.31, 0.69, 5)) == 0)
    assert law.acceleration(law.x1) == 0
    assert law.acceleration(law.x1 - 1e-12) != 0
    assert law.acceleration(law.x2) == pytest.approx(float(law.acceleration(law.x2 + 1e-9)))
    assert law.acceleration(law.x2) != 0


def test_points_on_the_diagonal_give_constant_speed() -> None:
    law = MotionLaw(0.3, 0.3, 0.7, 0.7, 1.0)
    t = np.linspace(0, 1, 31)
    assert law.position(t) == pytest.approx(t, abs=1e-15)


def test_reversed_time_and_position_is_the_mirrored_law() -> None:
    law, mirrored = MotionLaw(0.2, 0.4, 0.6, 0.5, 1.5), MotionLaw(0.4, 0.5, 0.8, 0.6, 1.5)
    t = np.linspace(0, 1, 41)
    assert mirrored.position(t) == pytest.approx(1 - law.position(1 - t), abs=1e-12)


@pytest.mark.parametrize("law", LAWS)
def test_range_bounds_the_positions_and_is_reached(law: MotionLaw) -> None:
    low, high = law.range()
    positions = law.position(np.linspace(0, 1, 100_001))
    assert positions.min() == pytest.approx(low, abs=1e-6)
    assert positions.max() == pytest.approx(high, abs=1e-6)
    assert low <= positions.min() + 1e-12
    assert high >= positions.max() - 1e-12


def test_cup_can_overshoot_its_stroke() -> None:
    # At P2 it moves eight strokes per cycle, and has a tenth of a stroke left.
    low, high = MotionLaw(0.45, 0.1, 0.55, 0.9, 0.2).range()
    assert low < -0.1
    assert high > 1.1


def test_wrong_laws_are_refused() -> None:
    with pytest.raises(InvalidDesign, match=r"x1 = 0.7 and x2 = 0.3"):
        MotionLaw(0.7, 0.4, 0.3, 0.6, 1.0)
    with pytest.raises(InvalidDesign, match="finite"):
        MotionLaw(0.2, float("nan"), 0.3, 0.6, 1.0)
    with pytest.raises(ConfigError, match=r"must lie in 0\.\.1"):
        LAWS[0].position(np.array([0.5, 1.2]))
