"""Filling: what a portion measures, and failures in plain words."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scene_portions import movement_to, portion_of

from fidelity.engine import Packing
from fidelity.grains.filling import filling_time, plane, rectangle, settled, strip, top_of
from mfopt.errors import SimulationError


def test_sizes_of_the_grain() -> None:
    portion = portion_of(30, length=0.035, width=0.01)
    assert portion.grain_length == pytest.approx(0.035)
    sphere = math.pi / 6 * portion.grain_diameter**3 * portion.grain_material.density
    assert sphere == pytest.approx(portion.grain.mass)
    assert portion.mass == pytest.approx(30 * portion.grain.mass)
    ball = portion_of(1, length=0.01, width=0.01)
    assert ball.grain_diameter == pytest.approx(0.01)


def test_a_failed_filling_says_why() -> None:
    movement = replace(movement_to(np.zeros((3, 3))), status="crashed", why="it exploded")
    with pytest.raises(SimulationError, match="it exploded"):
        settled(movement)


def test_a_leak_is_no_packing() -> None:
    movement = movement_to(np.zeros((3, 3)), exit_times=np.array([np.nan, 0.2, np.nan]))
    with pytest.raises(SimulationError, match="1 grains left"):
        settled(movement)


def test_the_packing_is_where_the_grains_came_to_rest() -> None:
    positions = np.arange(9.0).reshape(3, 3)
    np.testing.assert_array_equal(settled(movement_to(positions)).positions, positions)


def test_a_higher_fall_takes_longer() -> None:
    portion = portion_of(1)
    low, high = filling_time(portion, 0.1), filling_time(portion, 0.4)
    # The fall's share goes with the root of the height, on top of the same rest.
    assert high - low == pytest.approx(math.sqrt(2 * 0.1 / (0.6 * 9.81)))


def test_nothing_reaches_above_the_top() -> None:
    portion = portion_of(2)
    packing = Packing(np.array([[0.0, 0.0, 0.1], [0.0, 0.0, 0.2]]), np.eye(4)[[0, 0]])
    assert top_of(portion, packing) >= 0.2 + portion.grain_length / 2


def test_planes_and_strips_face_up_and_out() -> None:
    wall = plane(0.2, 0.1, 0.3)
    a, b, c = np.moveaxis(wall.vertices[wall.triangles], 1, 0)
    normals = np.cross(b - a, c - a)
    np.testing.assert_allclose(normals.sum(axis=0) / 2, [0.0, 0.0, 0.2 * 0.1])
    corners = np.array(rectangle(0.2, 0.1, 0.0) + rectangle(0.2, 0.1, 1.0))
    triangles = np.array(strip(np.arange(4), np.arange(4, 8)))
    a, b, c = np.moveaxis(corners[triangles], 1, 0)
    outward = np.einsum("ij,ij->i", np.cross(b - a, c - a), (a + b + c) * [1.0, 1.0, 0.0])
    assert (outward > 0).all()
