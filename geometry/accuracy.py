"""The distance between a mesh and the exact surface."""

import numpy as np

from geometry.loft import Loft
from geometry.mesh import Mesh, corners
from mfopt.arrays import Array


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
