"""Functions with known values, and runs of them as a surrogate is told."""

import numpy as np

from mfopt.arrays import Array, IntArray
from mfopt.search.surrogate import Observations


def sphere(z: Array) -> Array:
    return np.sum(z**2, axis=1)


def rosenbrock(z: Array) -> Array:
    x = 0.3 * z + 0.5
    return np.sum(100.0 * (x[:, 1:] - x[:, :-1] ** 2) ** 2 + (1.0 - x[:, :-1]) ** 2, axis=1)


def waves(z: Array) -> Array:
    """Unrelated to the others, of their size."""
    return 30.0 * (np.sin(2.0 * z[:, 1] + 1.0) + np.cos(1.5 * z[:, 2] * z[:, 0]))


def branin(z: Array) -> Array:
    """z in the unit square. Source: Forrester et al., Engineering Design (2008), appendix."""
    a, b = 15.0 * z[:, 0] - 5.0, 15.0 * z[:, 1]
    curve = b - 5.1 / (4.0 * np.pi**2) * a**2 + 5.0 / np.pi * a - 6.0
    return curve**2 + 10.0 * (1.0 - 1.0 / (8.0 * np.pi)) * np.cos(a) + 10.0


WING_LOWEST = np.array([150, 220, 6, -10, 16, 0.5, 0.08, 2.5, 1700, 0.025])
WING_HIGHEST = np.array([200, 300, 10, 10, 45, 1.0, 0.18, 6.0, 2500, 0.08])


def wing_weight(z: Array) -> Array:
    """z in the unit cube of 10 variables. Source: Forrester et al. (2008), appendix."""
    x = WING_LOWEST + z * (WING_HIGHEST - WING_LOWEST)
    area, fuel, aspect, sweep, pressure, taper, thickness, load, gross, paint = x.T
    cosine = np.cos(np.deg2rad(sweep))
    structure = 0.036 * area**0.758 * fuel**0.0035 * (aspect / cosine**2) ** 0.6
    structure *= pressure**0.006 * taper**0.04 * (100.0 * thickness / cosine) ** -0.3
    return structure * (load * gross) ** 0.49 + area * paint


def runs(
    z: Array, value: Array, level: IntArray | int = 0, counts: Array | None = None
) -> Observations:
    n = len(z)
    level = np.broadcast_to(level, n)
    return Observations(z, level, value, np.zeros((n, 0)) if counts is None else counts)
