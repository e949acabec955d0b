"""The hopper: a smooth loft through four rounded rectangles.

A CAD loft interpolates corresponding points of the sections by one B-spline; through four sections
the spline is one cubic. All sections have the same construction. So at every height z the loft is
exactly a rounded rectangle, whose length, width, radius and shift are cubics through the four given
values. One cubic has no jumps in curvature, unlike a spline of several pieces.
"""

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from geometry.sections import SLACK, SMALLEST_OPENING, SMALLEST_RADIUS, Section, check_section
from mfopt.arrays import Array, frozen
from mfopt.errors import ConfigError, InvalidDesign


@dataclass(frozen=True, eq=False)
class Loft:
    """Smooth surface through four sections, from the hole down to the tube."""

    heights: Array  # (4,) z of the sections [m], strictly decreasing
    sections: tuple[Section, ...]  # 4

    def __post_init__(self) -> None:
        heights = frozen(self.heights)
        if heights.shape != (4,) or len(self.sections) != 4:
            raise ConfigError(
                f"the loft has {heights.size} heights and {len(self.sections)} sections; "
                "give four of each, from the hole to the tube"
            )
        object.__setattr__(self, "heights", heights)
        object.__setattr__(self, "sections", tuple(self.sections))

    @cached_property
    def coefficients(self) -> Array:
        """Cubics of length, width, radius, shift in powers 0..3 of z - heights[0], (4, 4)."""
        nodes = self.heights - self.heights[0]
        differences = np.array([(s.length, s.width, s.radius, s.shift) for s in self.sections])
        # Newton's divided differences: equal sections give exactly constant cubics.
        for order in (1, 2, 3):
            spans = (nodes[order:] - nodes[:-order])[:, None]
            differences[order:] = np.diff(differences[order - 1 :], axis=0) / spans
        powers = np.zeros((4, 4))
        basis = np.array([1.0, 0.0, 0.0, 0.0])
        for node, difference in zip(nodes, differences, strict=True):
            powers += np.outer(basis, difference)
            basis = np.concatenate(([0.0], basis[:-1])) - node * basis
        return frozen(powers)

    def values(self, z: Array, derivative: int = 0) -> Array:
        """Length, width, radius and shift at the heights `z`, or their derivatives by z.

        Args:
            z: heights (n,) [m], from heights[3] to heights[0].
            derivative: 0, 1 or 2.

        Returns:
            Values (n, 4) [m], [-] or [1/m].
        """
        powers = np.polynomial.polynomial.polyder(self.coefficients, derivative)
        depth = np.asarray(z, dtype=np.float64) - self.heights[0]
        return np.asarray(np.polynomial.polynomial.polyval(depth, powers).T)

    def section(self, z: float) -> Section:
        """The rounded rectangle at height `z` [m]."""
        return Section(*map(float, self.values(np.array([z]))[0]))


def check_loft(loft: Loft) -> None:
    """Refuse a loft that cannot be built; the message names the fault.

    Raises:
        InvalidDesign: if sections cross (heights do not decrease), a section is invalid, or the
            loft is too narrow between the sections.
    """
    for i in range(3):
        if not math.inf > loft.heights[i] > loft.heights[i + 1] > -math.inf:
            raise InvalidDesign(
                f"crossed sections: section {i} at z = {loft.heights[i] * 1e3:.4g} mm must lie "
                f"above section {i + 1} at z = {loft.heights[i + 1] * 1e3:.4g} mm; "
                "exchange or move them"
            )
    for i, section in enumerate(loft.sections):
        check_section(section, f"section {i}")
    length, width, radius, _ = loft.coefficients.T
    opening, bend = SMALLEST_OPENING, SMALLEST_RADIUS
    _check_between(loft, length, opening, "length")
    _check_between(loft, width, opening, "width")
    _check_between(loft, radius, bend, "radius")
    _check_between(loft, length - 2 * radius, 0.0, "flat part of the length (length - 2 radius)")
    _check_between(loft, width - 2 * radius, 0.0, "flat part of the width (width - 2 radius)")


def check_tube(loft: Loft, tube_end_z: float) -> None:
    """Refuse a tube that ends inside the hopper.

    Raises:
        InvalidDesign: the message names both heights.
    """
    outlet = float(loft.heights[-1])
    if not -math.inf < tube_end_z < outlet - SLACK:
        raise InvalidDesign(
            f"tube end z = {tube_end_z * 1e3:.4g} mm must lie below the hopper's end = "
            f"{outlet * 1e3:.4g} mm; lower the tube's end"
        )


def _check_between(loft: Loft, cubic: Array, limit: float, quantity: str) -> None:
    """Refuse a loft whose `quantity`, a `cubic` in z - heights[0], falls below `limit` [m]."""
    depths = extremal_depths(cubic, float(loft.heights[-1] - loft.heights[0]))
    values = np.polynomial.polynomial.polyval(depths, cubic)
    lowest = int(np.argmin(values))
    if not values[lowest] >= limit - SLACK:
        z = depths[lowest] + loft.heights[0]
        raise InvalidDesign(
            f"pinched loft: {quantity} = {values[lowest] * 1e3:.4g} mm at z = {z * 1e3:.4g} mm, "
            f"between the sections, must be at least {limit * 1e3:g} mm; "
            "bring the neighbouring sections closer to each other"
        )


def extremal_depths(cubic: Array, end: float) -> Array:
    """Arguments from 0 to `end` where a cubic (4,) can be extreme: ends, stationary points.

    The quadratic is solved without cancellation, because many of the cubics are almost parabolas.
    """
    c, b, a = map(float, np.polynomial.polynomial.polyder(cubic))
    depths = [0.0, end]
    discriminant = b * b - 4 * a * c
    if discriminant >= 0:
        q = -(b + math.copysign(math.sqrt(discriminant), b)) / 2
        depths += [n / d for n, d in ((q, a), (c, q)) if d != 0]
    return np.clip(depths, min(0.0, end), max(0.0, end))
