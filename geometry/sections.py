"""A rounded rectangle, the cross-section of hole, hopper, tube and cup."""

import math
from dataclasses import dataclass

import numpy as np

from mfopt.arrays import Array, frozen
from mfopt.errors import InvalidDesign

# Smallest side of an opening [m]: five grain widths of 2 mm, the jamming edge (Beverloo's law).
SMALLEST_OPENING = 0.010
# Smallest corner radius [m]: sheet metal bends to about its own thickness, 1 mm.
SMALLEST_RADIUS = 0.001
# Slack of comparisons [m], far below workshop tolerances and far above rounding.
SLACK = 1e-9


@dataclass(frozen=True, slots=True)
class Section:
    """Rounded rectangle in a horizontal plane, centred at x = `shift`, y = 0."""

    length: float  # [m] along x
    width: float  # [m] along y
    radius: float  # [m] of the corners
    shift: float  # [m] along x

    @property
    def area(self) -> float:
        """Enclosed area, l w - (4 - pi) r^2 [m2]."""
        return self.length * self.width - (4 - math.pi) * self.radius**2

    @property
    def perimeter(self) -> float:
        """Length of the outline, 2 (l + w) - (8 - 2 pi) r [m]."""
        return 2 * (self.length + self.width) - (8 - 2 * math.pi) * self.radius

    def outline(self, corner_segments: int) -> Array:
        """Points on the outline, counter-clockwise from the upper end of the +x side.

        Where a side has no flat part (radius = half the side), its two end points coincide.

        Args:
            corner_segments: chords per quarter circle, at least 1.

        Returns:
            Points (4 (corner_segments + 1), 2) [m].
        """
        quarter = np.linspace(0.0, math.pi / 2, corner_segments + 1)
        # The first and last point of a corner lie exactly on the flats; cos(pi/2) is 6e-17.
        cosine = np.cos(quarter)
        cosine[-1] = 0.0
        sine = cosine[::-1]
        half_x, half_y = self.length / 2 - self.radius, self.width / 2 - self.radius
        x, y, r = half_x, half_y, self.radius
        corners = [
            np.column_stack([x + r * cosine, y + r * sine]),
            np.column_stack([-x - r * sine, y + r * cosine]),
            np.column_stack([-x - r * cosine, -y - r * sine]),
            np.column_stack([x + r * sine, -y - r * cosine]),
        ]
        return frozen(np.vstack(corners) + np.array([self.shift, 0.0]))


def section_fault(section: Section) -> str | None:
    """Why a sheet cannot have this section, or None."""
    half = min(section.length, section.width) / 2
    values = (section.length, section.width, section.radius, section.shift)
    if not all(map(math.isfinite, values)):
        return f"length, width, radius, shift = {values} must be finite numbers"
    for side, value in (("length", section.length), ("width", section.width)):
        if value < SMALLEST_OPENING - SLACK:
            return (
                f"{side} = {value * 1e3:.4g} mm must be at least {SMALLEST_OPENING * 1e3:g} mm, "
                f"or grains jam; increase the {side}"
            )
    if section.radius < SMALLEST_RADIUS - SLACK:
        return (
            f"radius = {section.radius * 1e3:.4g} mm must be at least {SMALLEST_RADIUS * 1e3:g} mm,"
            " or the sheet cannot be bent; increase the radius"
        )
    if section.radius > half + SLACK:
        return (
            f"radius = {section.radius * 1e3:.4g} mm must not exceed half the shorter side = "
            f"{half * 1e3:.4g} mm; reduce the radius or widen the section"
        )
    return None


def check_section(section: Section, name: str) -> None:
    """Refuse a section that a sheet cannot have.

    Raises:
        InvalidDesign: the message names section, quantity, value, limit and remedy.
    """
    fault = section_fault(section)
    if fault is not None:
        raise InvalidDesign(f"{name}: {fault}")
