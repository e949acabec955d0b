"""The model grain: equal spheres in a line, overlaps counted once.

The union of collinear equal spheres is cut midway between neighbouring centres into slices of
single spheres. A disc of radius rho(x) at x contributes pi rho^2 dx to the volume,
(pi/2) rho^4 dx to the moment about the axis and (pi/4) rho^4 dx + pi rho^2 x^2 dx to those
across it: polynomials of degree 4 at most, so three Gauss points per slice are exact.
"""

import numpy as np

from fidelity.engine import Grain
from mfopt.arrays import Array, frozen
from mfopt.errors import ConfigError


def grain_volume(length: float, width: float, spheres: int) -> float:
    """Volume of the union of the spheres [m3]."""
    return float(_moments(length, width, spheres)[0])


def portion_grain(
    *, mass: float, density: float, length: float, width: float, grains: int, spheres: int
) -> Grain:
    """Grain of a portion: shape kept, scaled so that `grains` of them have the portion's mass.

    A single sphere has no length to keep and only takes the volume.

    Args:
        mass: of the whole portion [kg].
        density: of the grain [kg/m3].
        length: of the unscaled grain [m].
        width: of the unscaled grain [m].
        grains: number of grains in the portion.
        spheres: number of spheres per grain.
    """
    volume = mass / density / grains
    scale = (volume / grain_volume(length, width, spheres)) ** (1 / 3)
    return line_grain(scale * length, scale * width, spheres, density)


def line_grain(length: float, width: float, spheres: int, density: float) -> Grain:
    """Grain of that length and width [m] made of equal spheres in a line.

    With so few spheres that they do not touch, the gaps stay: only length and width are kept.
    A grain as long as wide is one sphere: several in one place would only be stiffer.

    Raises:
        ConfigError: if the grain is wider than long.
    """
    volume, axial, across = _moments(length, width, spheres)
    centres = _centres(length, width, spheres)
    offsets = np.zeros((len(centres), 3))
    offsets[:, 0] = centres
    return Grain(
        offsets=frozen(offsets),
        radii=frozen(np.full(len(centres), width / 2)),
        mass=density * volume,
        inertia=frozen(density * np.array([axial, across, across])),
    )


def _centres(length: float, width: float, spheres: int) -> Array:
    if length < width:
        raise ConfigError(
            f"grain length = {length:g} m must be at least its width = {width:g} m; exchange them"
        )
    reach = (length - width) / 2
    return np.linspace(-reach, reach, spheres) if spheres > 1 and reach > 0.0 else np.zeros(1)


def _moments(length: float, width: float, spheres: int) -> tuple[float, float, float]:
    """Volume [m3], and integrals of the squared distance from the axis x and from y [m5]."""
    centres, r = _centres(length, width, spheres), width / 2
    half_gap = np.diff(centres) / 2
    low = np.maximum(-r, -np.concatenate([[np.inf], half_gap]))  # slice of each sphere, from its
    high = np.minimum(r, np.concatenate([half_gap, [np.inf]]))  # own centre
    nodes, weights = np.polynomial.legendre.leggauss(3)
    local = ((high + low)[:, None] + (high - low)[:, None] * nodes) / 2  # (k, 3)
    w = (high - low)[:, None] * weights / 2
    rho2 = r**2 - local**2
    x = centres[:, None] + local
    volume = np.pi * np.sum(w * rho2)
    axial = np.pi / 2 * np.sum(w * rho2**2)
    across = axial / 2 + np.pi * np.sum(w * rho2 * x**2)
    return float(volume), float(axial), float(across)
