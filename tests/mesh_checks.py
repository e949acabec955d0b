"""Questions asked of meshes: volume, open edges, quality, distance to the exact surface."""

import math
from collections.abc import Sequence

import numpy as np

from geometry.loft import Loft
from geometry.mesh import Mesh, corners
from mfopt.arrays import Array, IntArray

# Below this quality a triangle counts as degenerate: about 1 : 350 for a thin triangle. Double
# precision still gives its normal, but contact searches should not meet such a shape.
DEGENERATE = 0.005
# Vertices closer than this [m] are one: rounding is 1e-16 m, the shortest edge above 1e-5 m.
WELD = 1e-9


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


def capped(mesh: Mesh) -> Mesh:
    """The closed mesh of a tube whose first and last vertices are its upper and lower rim."""
    z = mesh.vertices[:, 2]
    upper, lower = np.flatnonzero(z == z.max()), np.flatnonzero(z == z.min())
    caps = [upper[cap(mesh.vertices[upper])], lower[cap(mesh.vertices[lower])[:, ::-1]]]
    return Mesh(mesh.vertices, np.vstack([mesh.triangles, *caps]))


def cap(points: Array) -> IntArray:
    """Triangles (m - 2, 3) that fill a convex ring of points (m, 3), facing up.

    A zigzag from the +x side to the -x side, taking the shorter diagonal each time.
    """
    low, high = 0, len(points) - 1
    triangles = []
    while high - low > 1:
        forward = math.dist(points[low + 1], points[high])
        backward = math.dist(points[low], points[high - 1])
        if forward <= backward:
            triangles.append((low, low + 1, high))
            low += 1
        else:
            triangles.append((low, high - 1, high))
            high -= 1
    return np.array(triangles, dtype=np.int64)


def chordal_error(mesh: Mesh, loft: Loft) -> float:
    """Largest horizontal distance between an open `passage` mesh and the exact surface [m].

    The distance is measured at 66 points of every triangle. The distance along the surface's normal
    is smaller, by the cosine of the wall's inclination.

    Args:
        mesh: hopper and tube without caps, see `geometry.parts.passage`.
        loft: the hopper; below it the exact surface is the prism of its last section.
    """
    i, j = np.triu_indices(11)
    weights = np.column_stack([i, j - i, 10 - j]) / 10  # barycentric, (66, 3)
    points = (weights @ corners(mesh)).reshape(-1, 3)
    return float(np.abs(distances(points, loft)).max())


def distances(points: Array, loft: Loft) -> Array:
    """Signed horizontal distance of points to the exact surface, negative inside.

    Args:
        points: (n, 3) [m].
        loft: the hopper, continued downwards by the tube and upwards by the hole.

    Returns:
        Distances (n,) [m].
    """
    z = np.clip(points[:, 2], loft.heights[-1], loft.heights[0])
    length, width, radius, shift = loft.values(z).T
    x = np.abs(points[:, 0] - shift) - (length / 2 - radius)
    y = np.abs(points[:, 1]) - (width / 2 - radius)
    outside = np.hypot(np.maximum(x, 0.0), np.maximum(y, 0.0))
    return np.asarray(outside + np.minimum(np.maximum(x, y), 0.0) - radius)
