"""Triangle meshes.

Normals follow the right-hand rule. In all parts of `geometry` they point away from the grains. So
parts can be joined, and closed meshes have a positive volume.
"""

from dataclasses import dataclass

import numpy as np

from mfopt.arrays import Array, IntArray, frozen


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
