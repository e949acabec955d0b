"""Rounded rectangles: closed forms, and what is refused."""

import math

import numpy as np
import pytest

from geometry.sections import Section, check_section
from mfopt.arrays import Array
from mfopt.errors import InvalidDesign


def polygon_area(points: Array) -> float:
    x, y = points.T
    return np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2


def test_circle_is_a_rounded_square_with_half_its_side_as_radius() -> None:
    circle = Section(0.08, 0.08, 0.04, 0.01)
    assert circle.area == pytest.approx(math.pi * 0.04**2)
    assert circle.perimeter == pytest.approx(math.pi * 0.08)
    points = circle.outline(7) - [0.01, 0.0]
    assert np.hypot(*points.T) == pytest.approx(0.04)


def test_outline_converges_to_area_and_perimeter_from_inside() -> None:
    section = Section(0.13, 0.1, 0.02, -0.03)
    fine, coarse = section.outline(400), section.outline(2)
    length = np.linalg.norm(np.roll(fine, -1, axis=0) - fine, axis=1).sum()
    assert polygon_area(fine) == pytest.approx(section.area, rel=1e-6)
    assert length == pytest.approx(section.perimeter, rel=1e-6)
    # Positive: counter-clockwise. Each corner of two chords lacks r^2 (pi/4 - sin(pi/4)).
    lack = 4 * 0.02**2 * (math.pi / 4 - math.sin(math.pi / 4))
    assert polygon_area(coarse) == pytest.approx(section.area - lack)


@pytest.mark.parametrize("n", [1, 2, 5])
def test_outline_reaches_all_four_sides(n: int) -> None:
    section = Section(0.13, 0.1, 0.02, -0.03)
    points = section.outline(n)
    assert points.shape == (4 * (n + 1), 2)
    assert points.max(axis=0) == pytest.approx([0.035, 0.05])
    assert points.min(axis=0) == pytest.approx([-0.095, -0.05])


@pytest.mark.parametrize(
    ("section", "words"),
    [
        (Section(0.1, 0.06, 0.031, 0.0), "radius = 31 mm must not exceed half .* = 30 mm"),
        (Section(0.005, 0.06, 0.002, 0.0), "length = 5 mm must be at least 10 mm"),
        (Section(0.1, -0.06, 0.002, 0.0), "width = -60 mm must be at least 10 mm"),
        (Section(0.1, 0.06, 0.0, 0.0), "radius = 0 mm must be at least 1 mm"),
        (Section(0.1, math.nan, 0.02, 0.0), "must be finite"),
    ],
)
def test_impossible_sections_are_named(section: Section, words: str) -> None:
    with pytest.raises(InvalidDesign, match=f"section 2: .*{words}"):
        check_section(section, "section 2")


def test_radius_of_exactly_half_the_side_is_allowed() -> None:
    check_section(Section(0.1, 0.06, 0.03, 0.0), "section 1")
