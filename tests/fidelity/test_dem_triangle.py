"""Nearest points on triangles, against brute force."""

import numba
import numpy as np
import pytest

from fidelity.dem.triangle import CORNER, EDGE, FACE, is_local_minimum, nearest_on_triangle
from mfopt.arrays import Array


@numba.njit
def nearest(t: Array, p: Array) -> tuple[float, float, float, int, int]:
    """`nearest_on_triangle`, callable from here."""
    return nearest_on_triangle(t, p[0], p[1], p[2])


@numba.njit
def minimal(directions: Array, d: Array) -> bool:
    """`is_local_minimum` over all directions."""
    return is_local_minimum(directions, 0, len(directions), d[0], d[1], d[2])


def packed(corners: Array) -> Array:
    a, b, c = corners
    return np.concatenate([a, b - a, c - a])


def projected(corners: Array, p: Array) -> Array:
    """Nearest point, by trying the face, then all edges, then all corners."""
    a, b, c = corners
    across = np.column_stack([b - a, c - a])
    u, v = np.linalg.lstsq(across, p - a, rcond=None)[0]
    if u >= 0 and v >= 0 and u + v <= 1:
        return np.asarray(a + across @ [u, v])
    points = []
    for s, e in ((a, b), (b, c), (c, a)):
        w = np.clip((p - s) @ (e - s) / ((e - s) @ (e - s)), 0.0, 1.0)
        points.append(s + w * (e - s))
    return np.asarray(min(points, key=lambda q: float(np.linalg.norm(p - q))))


def test_the_nearest_point_is_that_of_brute_force() -> None:
    rng = np.random.default_rng(5)
    seen = set()
    for _ in range(3000):
        corners = rng.normal(size=(3, 3))
        p = 2 * rng.normal(size=3)
        *d, where, which = nearest(packed(corners), p)
        assert p - np.array(d) == pytest.approx(projected(corners, p), abs=1e-9)
        seen.add((where, which))
    assert seen == {(FACE, 0), *((w, n) for w in (EDGE, CORNER) for n in range(3))}


@pytest.mark.parametrize("height", [0.0, 0.3, -0.3])
def test_the_nearest_point_says_where_it_lies(height: float) -> None:
    t = packed(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))
    places = {
        (0.25, 0.25): (FACE, 0),
        (0.5, -1.0): (EDGE, 0),
        (1.0, 1.0): (EDGE, 1),
        (-1.0, 0.5): (EDGE, 2),
        (-1.0, -1.0): (CORNER, 0),
        (2.0, -0.5): (CORNER, 1),
        (-0.5, 2.0): (CORNER, 2),
    }
    for (x, y), expected in places.items():
        assert nearest(t, np.array([x, y, height]))[3:] == expected


def test_a_needle_keeps_its_nearest_point() -> None:
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 1e-6, 0.0]])
    d = nearest(packed(corners), np.array([0.3, 0.2, 0.1]))[:3]
    assert np.linalg.norm(d) == pytest.approx(np.hypot(0.2, 0.1), abs=2e-6)


def test_a_point_on_an_edge_is_a_minimum_where_no_way_leads_closer() -> None:
    # Above a ridge every way down leads away; above a valley both lead up to the point.
    for fall, expected in ((-0.5, True), (0.5, False)):
        ways = np.array([[1.0, 0.0, fall], [-1.0, 0.0, fall]]) / np.hypot(1.0, fall)
        assert minimal(ways, np.array([0.0, 0.0, 1.0])) is expected
    flat = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])
    assert minimal(flat, np.array([0.0, 0.0, 1.0]))  # a seam in a plane is as good as its face
    assert not minimal(flat, np.array([1e-6, 0.0, 1.0]))
