"""The note for the workshop, against shapes with known angles and curvatures."""

import math

import numpy as np
import pytest
from hopper_designs import CURVED, HEIGHTS, HOLE, TUBE, prism, straight

from geometry.loft import Loft
from geometry.manufacturability import manufacturability
from geometry.sections import Section


def test_prism_is_upright_and_bent_by_its_corners_only() -> None:
    note = manufacturability(prism(TUBE))
    assert note.largest_wall_angle == 0
    assert note.largest_curvature == pytest.approx(1 / TUBE.radius)
    assert note.curved_place == "corner"
    assert note.developable
    assert not note.self_intersecting


def test_cone_has_its_own_angle_and_curvature() -> None:
    # Circles from radius 80 to 28 mm over 260 mm: slope 0.2.
    radii = [0.08 + 0.2 * z for z in HEIGHTS]
    note = manufacturability(Loft(HEIGHTS, tuple(Section(2 * r, 2 * r, r, 0) for r in radii)))
    assert note.smallest_wall_angle == pytest.approx(math.atan(0.2))
    assert note.largest_wall_angle == pytest.approx(math.atan(0.2))
    assert note.flattest_narrows
    # Normal curvature of a cone of half angle a at radius r: cos(a) / r, largest at its end.
    assert note.largest_curvature == pytest.approx(math.cos(math.atan(0.2)) / radii[-1])
    assert note.curved_z == pytest.approx(-0.26)
    assert note.developable


def test_straight_loft_between_different_sections_is_developable() -> None:
    note = manufacturability(straight())
    assert note.largest_gaussian_curvature < 1e-9
    assert note.developable
    # The hole's +x side moves in by 27.5 mm over 260 mm, its y sides by 22.5 mm;
    # the corner between them, as between the walls of a pyramid, is flatter than either.
    assert note.largest_wall_angle == pytest.approx(
        math.atan(math.hypot(27.5, 22.5) / 260), rel=1e-4
    )
    assert "developable" in " ".join(note.sentences())


def test_shift_alone_tilts_the_walls() -> None:
    sections = tuple(Section(0.1, 0.08, 0.02, 0.5 * z) for z in HEIGHTS)
    note = manufacturability(Loft(HEIGHTS, sections))
    assert note.largest_wall_angle == pytest.approx(math.atan(0.5))
    assert note.smallest_wall_angle == pytest.approx(0, abs=1e-9)
    assert note.developable


def test_curvatures_agree_with_finite_differences() -> None:
    note = manufacturability(CURVED)
    gaussian, principal = [], []
    for z in np.linspace(-0.26, 0.0, 53):
        for angle in np.linspace(0.001, math.pi - 0.001, 24):
            k, largest = measured_curvatures(CURVED, z, angle)
            gaussian.append(abs(k))
            principal.append(largest)
    assert note.largest_gaussian_curvature == pytest.approx(max(gaussian), rel=0.05)
    assert note.largest_curvature == pytest.approx(max(principal), rel=0.02)
    assert not note.developable


def measured_curvatures(loft: Loft, z: float, angle: float, h=1e-4) -> tuple[float, float]:
    """Gaussian and largest principal curvature at a corner's point, by finite differences."""

    def point(height, a):
        s = loft.section(height)
        side = math.copysign(1.0, math.cos(angle))
        x = s.shift + side * (s.length / 2 - s.radius) + s.radius * math.cos(a)
        return np.array([x, s.width / 2 - s.radius + s.radius * math.sin(a), height])

    centre = point(z, angle)
    up, down = point(z + h, angle), point(z - h, angle)
    on, back = point(z, angle + h), point(z, angle - h)
    x_z, x_a = (up - down) / (2 * h), (on - back) / (2 * h)
    normal = np.cross(x_a, x_z)
    normal /= np.linalg.norm(normal)
    crossed = point(z + h, angle + h) - point(z + h, angle - h)
    crossed = (crossed - point(z - h, angle + h) + point(z - h, angle - h)) / (4 * h * h)
    first = np.array([[x_a @ x_a, x_a @ x_z], [x_a @ x_z, x_z @ x_z]])
    bends = np.array([on - 2 * centre + back, crossed, crossed, up - 2 * centre + down])
    bends[[0, 3]] /= h * h
    shape = np.linalg.solve(first, (bends @ normal).reshape(2, 2))
    return np.linalg.det(shape), np.abs(np.linalg.eigvals(shape)).max()


def test_overlapping_corners_are_told_as_self_intersection() -> None:
    middle = Section(0.12, 0.06, 0.03, 0.0)
    note = manufacturability(Loft(HEIGHTS, (HOLE, middle, middle, TUBE)))
    assert note.self_intersecting
    assert "intersects itself" in " ".join(note.sentences())


def test_note_reads_as_sentences_with_units() -> None:
    sentences = manufacturability(CURVED).sentences()
    assert all(sentence.endswith(".") for sentence in sentences)
    text = " ".join(sentences)
    for unit in ("degrees", "mm", "1/m,", "1/m\u00b2"):
        assert unit in text
