"""Questions asked of meshes, on shapes with known answers."""

import math

import numpy as np
import pytest

from geometry.mesh import Mesh
from mesh_checks import merged, open_edges, smallest_quality, volume

TETRAHEDRON = Mesh(
    np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
    np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]),
)


def test_volume_of_a_tetrahedron_wherever_it_stands() -> None:
    assert volume(TETRAHEDRON) == pytest.approx(1 / 6)
    moved = Mesh(TETRAHEDRON.vertices + 7.0, TETRAHEDRON.triangles)
    assert volume(moved) == pytest.approx(1 / 6)
    assert volume(Mesh(moved.vertices, moved.triangles[:, ::-1])) == pytest.approx(-1 / 6)


def test_open_edges_are_those_of_a_missing_triangle() -> None:
    assert len(open_edges(TETRAHEDRON)) == 0
    opened = Mesh(TETRAHEDRON.vertices, TETRAHEDRON.triangles[:-1])
    assert {tuple(edge) for edge in open_edges(opened)} == {(0, 2), (0, 3), (2, 3)}


def test_quality_is_one_for_equilateral_and_falls_to_nothing() -> None:
    def triangle(x, y):
        return Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [x, y, 0]]), np.array([[0, 1, 2]]))

    assert smallest_quality(triangle(0.5, math.sqrt(3) / 2)) == pytest.approx(1.0)
    assert smallest_quality(triangle(0.5, 0.0)) == 0.0
    assert smallest_quality(triangle(0.5, 1000.0)) == pytest.approx(math.sqrt(3) / 1000, rel=1e-3)


def test_merged_parts_share_the_vertices_at_the_same_place() -> None:
    halves = [Mesh(TETRAHEDRON.vertices, TETRAHEDRON.triangles[i : i + 2]) for i in (0, 2)]
    whole = merged(halves)
    assert len(whole.vertices) == 4
    assert len(open_edges(whole)) == 0
    assert volume(whole) == pytest.approx(1 / 6)


def test_meshes_cannot_be_edited() -> None:
    with pytest.raises(ValueError, match="read-only"):
        TETRAHEDRON.vertices[0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        TETRAHEDRON.triangles[0, 0] = 1
