"""Triangle meshes: a record and functions of it.

Normals follow the right-hand rule. In all parts of `geometry` they point away from the grains. So
parts can be joined, and closed meshes have a positive volume.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mfopt.arrays import Array, IntArray, frozen

# Below this quality a triangle counts as degenerate: about 1 : 350 for a thin triangle. Double
# precision still gives its normal, but contact searches should not meet such a shape.
DEGENERATE = 0.005
# Vertices closer than this [m] are one: rounding is 1e-16 m, the shortest edge above 1e-5 m.
WELD = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """A triangle mesh."""

    vertices: Array  # (v, 3) [m]
    triangles: IntArray  # (t, 3) indices of vertices, counter-clockwise seen from outside

    def __post_init__(self) -> None:
        triangles = np.array(self.triangles, dtype=np.int64).reshape(-1, 3)
        triangles.flags.writeable = False
        object.__setattr__(self, "vertices", frozen(self.vertices))
        object.__setattr__(self, "triangles", triangles)


def corners(mesh: Mesh) -> Array:
    """Corner points of every triangle, (t, 3, 3) [m]."""
    return np.asarray(mesh.vertices[mesh.triangles])


def volume(mesh: Mesh) -> float:
    """Signed volume of a closed mesh, positive if its normals point outwards [m3]."""
    a, b, c = np.moveaxis(corners(mesh), 1, 0)
    return float(np.sum(a * np.cross(b, c)) / 6)


def open_edges(mesh: Mesh) -> IntArray:
    """Edges (m, 2) that belong to one triangle only: the rims of an open mesh."""
    edges = np.sort(mesh.triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    found, count = np.unique(edges, axis=0, return_counts=True)
    return np.asarray(found[count == 1])


def quality(mesh: Mesh) -> Array:
    """Shape of every triangle, 4 sqrt(3) area / sum of squared edges, (t,).

    1 for an equilateral triangle, 0 for three points on a line, sqrt(3) b / h for a thin triangle
    with a base b much shorter than the height h.
    """
    points = corners(mesh)
    sides = np.roll(points, -1, axis=1) - points
    areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / 2
    squares = np.sum(sides**2, axis=(1, 2))
    return np.asarray(4 * np.sqrt(3) * areas / squares)


def smallest_quality(mesh: Mesh) -> float:
    """Quality of the worst triangle, 0..1; below `DEGENERATE` it counts as degenerate."""
    return float(quality(mesh).min())


def merged(meshes: Sequence[Mesh]) -> Mesh:
    """One mesh of several, with vertices at the same place made one."""
    vertices = np.vstack([mesh.vertices for mesh in meshes])
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
    triangles = np.vstack([m.triangles + s for m, s in zip(meshes, starts, strict=True)])
    places = np.round(vertices / WELD).astype(np.int64)
    _, first, index = np.unique(places, axis=0, return_index=True, return_inverse=True)
    return Mesh(vertices[first], index.reshape(-1)[triangles])
