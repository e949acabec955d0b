"""Turning points by unit quaternions."""

import numpy as np

from mfopt.arrays import Array


def rotate(quaternions: Array, offsets: Array) -> Array:
    """Turn offsets (k, 3) by each unit quaternion w, x, y, z (n, 4); gives (n, k, 3)."""
    w, v = quaternions[:, None, :1], quaternions[:, None, 1:]
    twice = 2.0 * np.cross(v, offsets)
    return np.asarray(offsets + w * twice + np.cross(v, twice))
