"""Rings and strips between them."""

import math

import numpy as np
import pytest

from geometry.mesh import Mesh
from geometry.rings import chords, ring, sagitta, strip
from geometry.sections import Section
from mesh_checks import capped, open_edges, smallest_quality, volume
from mfopt.arrays import Array


@pytest.mark.parametrize("radius", [0.001, 0.005, 0.025, 0.045])
@pytest.mark.parametrize("error", [0.0003, 0.001, 0.003])
def test_chords_are_the_fewest_within_half_the_error(radius: float, error: float) -> None:
    n = chords(radius, error)
    assert sagitta(radius, error) == pytest.approx(radius * (1 - math.cos(math.pi / 4 / n)))
    assert sagitta(radius, error) <= error / 2 * (1 + 1e-9)
    assert n == 1 or radius * (1 - math.cos(math.pi / 4 / (n - 1))) > error / 2


@pytest.mark.parametrize(
    ("section", "corners"),
    [
        (Section(0.1, 0.08, 0.02, 0.0), 4),
        (Section(0.1, 0.04, 0.02, 0.0), 2),  # no flat part along y
        (Section(0.04, 0.1, 0.02, 0.0), 2),  # none along x
        (Section(0.04, 0.04, 0.02, 0.0), 0),  # a circle
    ],
)
def test_ring_is_convex_without_repeated_points(section: Section, corners: int) -> None:
    found = ring(section, -0.1, 0.001)
    assert len(found.points) == 4 * chords(0.02, 0.001) + corners
    assert found.edges.min() > 0.005
    sides = np.roll(found.points, -1, axis=0) - found.points
    turns = np.cross(sides, np.roll(sides, -1, axis=0))[:, 2]
    assert np.all(turns > 0)
    # The stated directions of the edges' normals are the true ones.
    angle = found.directions * math.pi / 2
    normals = np.column_stack([sides[:, 1], -sides[:, 0]]) / found.edges[:, None]
    assert normals == pytest.approx(np.column_stack([np.cos(angle), np.sin(angle)]), abs=1e-9)


@pytest.mark.parametrize("lower", [Section(0.06, 0.05, 0.003, 0.02), Section(0.05, 0.05, 0.025, 0)])
def test_strip_between_different_rings_closes_and_holds_the_volume_of_minkowski(
    lower: Section,
) -> None:
    above, below = ring(Section(0.1, 0.08, 0.03, 0), 0.1, 0.001), ring(lower, 0.0, 0.001)
    mesh = capped(Mesh(np.vstack([above.points, below.points]), strip(above, below)))
    assert len(open_edges(mesh)) == 0
    assert smallest_quality(mesh) > 0.02
    # Cuts are (1 - t) A + t B, so the area is quadratic in t: Simpson's rule is exact.
    middle = (cut_area(mesh, 0.05),)
    ends = [polygon_area(r.points) for r in (above, below)]
    assert volume(mesh) == pytest.approx(0.1 * (sum(ends) + 4 * middle[0]) / 6)


def cut_area(mesh: Mesh, height: float) -> float:
    """Area of the convex cut of a mesh, from where its edges cross the plane."""
    edges = mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    a, b = mesh.vertices[edges[:, 0]], mesh.vertices[edges[:, 1]]
    crossing = (a[:, 2] - height) * (b[:, 2] - height) < 0
    t = ((height - a[crossing, 2]) / (b[crossing, 2] - a[crossing, 2]))[:, None]
    points = np.unique((a[crossing] + t * (b[crossing] - a[crossing])).round(12), axis=0)
    centre = points.mean(axis=0)
    order = np.argsort(np.arctan2(points[:, 1] - centre[1], points[:, 0] - centre[0]))
    return polygon_area(points[order])


def polygon_area(points: Array) -> float:
    x, y = points.T[:2]
    return np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2
