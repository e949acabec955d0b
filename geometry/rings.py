"""Rings of points around a section, and the strips of triangles between two rings.

A ring is a convex polygon inscribed in a rounded rectangle. The number of chords in the corners
follows from the corner radius. Two rings are joined edge by edge in the order of the edges'
directions. Every horizontal cut of such a strip is the convex polygon (1 - t) A + t B (Minkowski
sum). So the error of the strip is at most the error of its rings, plus the error of linear
interpolation. Rings with different numbers of points need no special case, and a side of length 0
leaves no degenerate triangle.
"""

import math
from dataclasses import dataclass

import numpy as np

from geometry.sections import Section
from mfopt.arrays import Array, IntArray, frozen

# Shares of the chordal error: half for the chords of the corners. A flat side shorter than half of
# the error is closed up, which moves its neighbours by a quarter. The rest is for the linear
# interpolation between rings.
CHORD_SHARE = 0.5
CLOSED_SIDE_SHARE = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class Ring:
    """A convex polygon at one height, counter-clockwise seen from above."""

    points: Array  # (m, 3) [m]
    directions: (
        Array  # (m,) of the outward normal of edge i to i + 1 [quarter turns], rising in 0..4
    )

    @property
    def edges(self) -> Array:
        """Lengths of the edges (m,) [m]."""
        return np.asarray(np.linalg.norm(np.roll(self.points, -1, axis=0) - self.points, axis=1))


def chords(radius: float, chordal_error: float) -> int:
    """Fewest chords of a quarter circle within `chordal_error` [m], sagitta r (1 - cos(pi/4n))."""
    share = CHORD_SHARE * chordal_error
    if share >= radius * (1 - math.cos(math.pi / 4)):
        return 1
    return math.ceil(math.pi / 4 / math.acos(1 - share / radius) - 1e-9)


def sagitta(radius: float, chordal_error: float) -> float:
    """Largest distance between the chords of a corner and its arc [m]."""
    return radius * (1 - math.cos(math.pi / 4 / chords(radius, chordal_error)))


def closed_up(section: Section, chordal_error: float) -> Section:
    """The section without flat parts shorter than its share of `chordal_error` [m]."""
    shortest = CLOSED_SIDE_SHARE * chordal_error
    corner = 2 * section.radius
    length = corner if section.length - corner < shortest else section.length
    width = corner if section.width - corner < shortest else section.width
    return Section(length, width, section.radius, section.shift)


def ring(section: Section, z: float, chordal_error: float) -> Ring:
    """Points around `section` at height `z` [m], within `chordal_error` [m] of its outline."""
    n = chords(section.radius, chordal_error)
    shape = closed_up(section, chordal_error)
    outline = shape.outline(n)
    corner = np.append((np.arange(n) + 0.5) / n, 1.0)  # n chords, then the flat side
    directions = np.concatenate([k + corner for k in range(4)])
    kept = np.ones(4 * (n + 1), dtype=bool)
    # Flats after the corners 1 and 3 run along x, after 2 and 4 along y.
    kept[[n, 3 * n + 2]] = shape.length > 2 * shape.radius
    kept[[2 * n + 1, 4 * n + 3]] = shape.width > 2 * shape.radius
    points = np.column_stack([outline, np.full(len(outline), z)])
    return Ring(frozen(points[kept]), frozen(directions[kept]))


def strip(upper: Ring, lower: Ring) -> IntArray:
    """Triangles between two rings, facing outwards.

    Returns:
        Indices (t, 3): those of `upper` first, then those of `lower`.
    """
    m, n = len(upper.points), len(lower.points)
    ends = np.array([math.inf])
    above, below = np.append(upper.directions, ends), np.append(lower.directions, ends)
    triangles: list[tuple[int, int, int]] = []
    i = j = 0
    while i < m or j < n:
        if abs(above[i] - below[j]) < 1e-9:
            triangles += _quad(upper, lower, i, j)
            i, j = i + 1, j + 1
        elif above[i] < below[j]:
            triangles.append((i, m + j % n, (i + 1) % m))
            i += 1
        else:
            triangles.append((i % m, m + j, m + (j + 1) % n))
            j += 1
    return np.array(triangles, dtype=np.int64)


def _quad(upper: Ring, lower: Ring, i: int, j: int) -> list[tuple[int, int, int]]:
    """Two triangles between edge `i` above and edge `j` below, split along the shorter diagonal."""
    m, n = len(upper.points), len(lower.points)
    i_next, j_next = (i + 1) % m, (j + 1) % n
    falling = math.dist(upper.points[i], lower.points[j_next])
    rising = math.dist(lower.points[j], upper.points[i_next])
    a, a_next, b, b_next = i, i_next, m + j, m + j_next
    if falling <= rising:
        return [(a, b, b_next), (a, b_next, a_next)]
    return [(a, b, a_next), (a_next, b, b_next)]
