"""Questions of the workshop about a hopper: angles, curvature, can a flat sheet be bent to it.

The answers are notes for the engineer; the search ignores them. The surface is described by the
support function h(z, a) = s cos a + (l/2 - r) |cos a| + (w/2 - r) |sin a| + r of its sections,
with the direction a of the wall's normal seen from above. With m = dh/dz the angle between wall and
vertical is atan |m|. Corners (radius r) have the fundamental forms
E = r^2, F = r dm/da, G = 1 + m^2 + (dm/da)^2, L = -r / q, M = 0, N = (dm/dz) / q with
q = sqrt(1 + m^2); flat sides are bent about one horizontal axis only.
"""

import math
from dataclasses import dataclass

import numpy as np

from geometry.loft import Loft
from mfopt.arrays import Array

# Gaussian curvature up to which a sheet counts as developable [1/m2]: flattening a patch of
# 0.1 m strains it by about K a^2 / 24 = 0.04 %, below the elastic limit of mild steel of
# 235 MPa / 210 GPa = 0.11 %.
DEVELOPABLE = 1.0
# Grid over the height, and over the angle in each of the two corners with y >= 0 (the other two
# mirror them). [1]
HEIGHTS, ANGLES = 401, 17


@dataclass(frozen=True, slots=True)
class Manufacturability:
    """Shape of the hopper's sheet; angles to the vertical, heights z above the plate."""

    smallest_wall_angle: float  # [rad]
    largest_wall_angle: float  # [rad], the flattest wall
    flattest_z: float  # [m]
    flattest_narrows: bool  # whether the flattest wall leads grains inwards on their way down
    largest_curvature: float  # [1/m], largest principal curvature
    curved_z: float  # [m]
    curved_place: str  # "corner" or "flat side"
    largest_gaussian_curvature: float  # [1/m2], in magnitude
    self_intersecting: bool

    @property
    def developable(self) -> bool:
        """Whether a flat sheet can be bent to the shape without stretching."""
        return self.largest_gaussian_curvature <= DEVELOPABLE

    def sentences(self) -> list[str]:
        """The note in plain English."""
        way = "inwards" if self.flattest_narrows else "outwards"
        return [
            f"The walls are {math.degrees(self.smallest_wall_angle):.0f} to "
            f"{math.degrees(self.largest_wall_angle):.0f} degrees from the vertical. The flattest "
            f"wall is at z = {self.flattest_z * 1e3:.0f} mm and leads {way} on the way down.",
            f"The largest curvature is {self.largest_curvature:.0f} 1/m, a bending radius of "
            f"{1e3 / max(self.largest_curvature, 1e-9):.1f} mm, in a {self.curved_place} at "
            f"z = {self.curved_z * 1e3:.0f} mm.",
            self._developable_sentence(),
            "The surface intersects itself: the design cannot be built as it is."
            if self.self_intersecting
            else "The surface does not intersect itself.",
        ]

    def _developable_sentence(self) -> str:
        k = self.largest_gaussian_curvature
        curvature = f"{k:.0f} 1/m\u00b2" if k >= 10.0 else f"{max(k, 0.1):.1f} 1/m\u00b2"
        if self.developable:
            return (
                f"The sheet is developable: the Gaussian curvature is at most {curvature}, below "
                f"the limit of {DEVELOPABLE:g} 1/m\u00b2, so a flat sheet can be bent to the shape."
            )
        return (
            f"The sheet is not developable: the Gaussian curvature is up to {curvature}, above "
            f"the limit of {DEVELOPABLE:g} 1/m\u00b2, so the sheet must be stretched, pressed, or "
            "made of strips."
        )


def manufacturability(loft: Loft) -> Manufacturability:
    """Describe the hopper's sheet, without the tube."""
    z = np.linspace(loft.heights[0], loft.heights[-1], HEIGHTS)
    angle = np.linspace(0.0, math.pi / 2, ANGLES)
    angle = np.concatenate([angle, math.pi / 2 + angle])
    slope = _support(loft, z, angle, 1)
    steepness = np.abs(slope)
    flattest = np.unravel_index(np.argmax(steepness), slope.shape)
    gaussian, corner_curvature = _corner_curvatures(loft, z, angle)
    side_curvature = _side_curvatures(loft, z)
    in_corner = corner_curvature.max() >= side_curvature.max()
    curved = corner_curvature if in_corner else side_curvature
    return Manufacturability(
        smallest_wall_angle=math.atan(steepness.min()),
        largest_wall_angle=math.atan(steepness.max()),
        flattest_z=float(z[flattest[0]]),
        flattest_narrows=bool(slope[flattest] > 0),
        largest_curvature=float(curved.max()),
        curved_z=float(z[np.unravel_index(np.argmax(curved), curved.shape)[0]]),
        curved_place="corner" if in_corner else "flat side",
        largest_gaussian_curvature=float(np.abs(gaussian).max()),
        self_intersecting=_self_intersecting(loft, z),
    )


def _support(loft: Loft, z: Array, angle: Array, derivative: int) -> Array:
    """Derivative by z of the support function on the grid (heights, angles)."""
    length, width, radius, shift = loft.values(z, derivative).T[:, :, None]
    cosine, sine = np.cos(angle), np.sin(angle)
    flats = (length / 2 - radius) * np.abs(cosine) + (width / 2 - radius) * np.abs(sine)
    return np.asarray(shift * cosine + flats + radius)


def _corner_curvatures(loft: Loft, z: Array, angle: Array) -> tuple[Array, Array]:
    """Gaussian and largest principal curvature in the corners, on the grid (heights, angles)."""
    radius = loft.values(z)[:, 2:3]
    length, width, bend, shift = loft.values(z, 1).T[:, :, None]
    cosine, sine = np.cos(angle), np.sin(angle)
    m, m_z = _support(loft, z, angle, 1), _support(loft, z, angle, 2)
    # dm/da; the first corner has its centre at +(l/2 - r), the second at -(l/2 - r).
    right = np.repeat([1.0, -1.0], ANGLES)
    m_angle = (width / 2 - bend) * cosine - (shift + right * (length / 2 - bend)) * sine
    q2 = 1 + m**2
    gaussian = -m_z / (radius * q2**2)
    mean = (m_z - (q2 + m_angle**2) / radius) / (2 * q2**1.5)
    root = np.sqrt(np.maximum(mean**2 - gaussian, 0.0))
    return gaussian, np.abs(mean) + root


def _side_curvatures(loft: Loft, z: Array) -> Array:
    """Curvature of the flat sides x = s + l/2, y = w/2, x = s - l/2 over the heights, (n, 3)."""
    sides = np.array([0.0, math.pi / 2, math.pi])
    slope, bend = _support(loft, z, sides, 1), _support(loft, z, sides, 2)
    return np.asarray(np.abs(bend) / (1 + slope**2) ** 1.5)


def _self_intersecting(loft: Loft, z: Array) -> bool:
    """Whether heights cross, or an outline crosses itself because its corners overlap.

    Sections at different heights lie in different planes, so there is no other way.
    """
    length, width, radius, _ = loft.values(z).T
    overlapping = np.minimum(length, width) < 2 * np.maximum(radius, 0.0) - 1e-9
    return bool(np.any(np.diff(loft.heights) >= 0) or np.any(overlapping) or np.any(radius < 0))
