"""Where a moved wall is, and how fast it can be."""

import math

import numpy as np
import pytest

from fidelity.engine import WallMotion
from fidelity.engines.wall_motion import angle_at, rotation, shift_at, top_speed

TIMES = np.array([0.0, 0.5, 2.0])
WAY = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 2.0], [1.0, 3.0, 2.0]])
QUARTER = WallMotion(
    TIMES, WAY, np.array([0.0, 0.0, math.pi / 2]), axis=(0.0, 0.0, 1.0), pivot=(1.0, 0.0, 5.0)
)
POINTS = np.array([[2.0, 0.0, 0.0], [1.0, 0.0, -7.0], [1.0, 4.0, 1.0]])


def test_motion_is_linear_between_samples_and_holds_afterwards() -> None:
    slide = WallMotion(TIMES, WAY)
    assert shift_at(slide, POINTS, 0.25) == pytest.approx(np.tile([0.5, 0.0, 1.0], (3, 1)))
    assert shift_at(slide, POINTS, 9.0) == pytest.approx(np.tile(WAY[-1], (3, 1)))
    assert angle_at(slide, 1.0) == 0.0
    assert angle_at(QUARTER, 1.25) == pytest.approx(math.pi / 4)
    assert angle_at(QUARTER, 9.0) == pytest.approx(math.pi / 2)


def test_a_turn_is_about_the_pivot_and_a_displacement_comes_on_top() -> None:
    placed = POINTS + shift_at(QUARTER, POINTS, 2.0)
    expected = np.array([[1.0, 1.0, 0.0], [1.0, 0.0, -7.0], [-3.0, 0.0, 1.0]]) + WAY[-1]
    assert placed == pytest.approx(expected)


def test_rotation_turns_by_the_right_hand_and_keeps_its_axis() -> None:
    axis = (2 / 7, 3 / 7, 6 / 7)
    turn = rotation(axis, 0.8)
    assert turn @ turn.T == pytest.approx(np.eye(3))
    assert np.linalg.det(turn) == pytest.approx(1.0)
    assert turn @ axis == pytest.approx(axis)
    assert rotation((1.0, 0.0, 0.0), math.pi / 2) @ [0.0, 1.0, 0.0] == pytest.approx([0, 0, 1])
    assert turn == pytest.approx(rotation(axis, 0.3) @ rotation(axis, 0.5))


def test_top_speed_bounds_every_point_and_is_reached() -> None:
    assert top_speed(None, POINTS) == 0.0
    assert top_speed(WallMotion(TIMES, WAY), POINTS) == pytest.approx(math.sqrt(20.0))
    assert top_speed(WallMotion(np.zeros(1), np.zeros((1, 3))), POINTS) == 0.0
    still = WallMotion(TIMES, 0 * WAY, QUARTER.angles, QUARTER.axis, QUARTER.pivot)
    assert top_speed(still, POINTS) == pytest.approx(4.0 * math.pi / 3)  # of the last point
    fine = np.linspace(0.0, 2.0, 2001)
    path = np.array([shift_at(QUARTER, POINTS, t) for t in fine])
    speeds = np.linalg.norm(np.diff(path, axis=0), axis=2) / np.diff(fine)[:, None]
    assert speeds.max() <= top_speed(QUARTER, POINTS) * (1 + 1e-9)
