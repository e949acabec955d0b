"""The parts of the dosing machine as meshes: cup, plate with hole, hopper with tube.

Frame: x along the cup's stroke, y across, z up, the plate at z = 0; metres.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from geometry.loft import Loft, check_loft, check_tube
from geometry.mesh import Mesh
from geometry.rings import Ring, closed_up, ring, sagitta, strip
from geometry.sections import SLACK, Section, check_section
from mfopt.arrays import Array
from mfopt.errors import ConfigError, InvalidDesign

# Wanted quality of thin triangles, 4 sqrt(3) area / sum of squared edges: about 1 : 90. A straight
# piece has one span, or more if the triangles would be thinner.
THINNEST = 0.02
# Number of heights at which the exact surface, a cubic, is sampled [1]: 1.3 mm apart.
SAMPLES = 200


@dataclass(frozen=True, slots=True)
class Cup:
    """The dosing cup: straight walls on the plate, open at top and bottom."""

    section: Section
    volume: float  # [m3]

    @property
    def height(self) -> float:
        """Inner height that holds the volume [m]."""
        return self.volume / self.section.area


def cup_wall(cup: Cup, chordal_error: float, height: float | None = None) -> Mesh:
    """Side wall of the cup, from z = 0 to its height, or to `height` [m].

    The mesh is inscribed, so its volume is smaller than the cup's by a share of about
    (2/3) 2 pi r e / area, with the sagitta e <= chordal_error / 2. For the 130 x 100 x 20 mm cup
    the share is 0.25 % at 1 mm and 0.45 % at 1.4 mm.
    """
    _check_chordal_error(chordal_error)
    check_section(cup.section, "cup")
    top = cup.height if height is None else height
    if not (math.isfinite(top) and top > SLACK):
        raise InvalidDesign(f"cup height = {1e3 * top:.4g} mm must exceed 0; increase its volume")
    upper, lower = (ring(cup.section, z, chordal_error) for z in (top, 0.0))
    heights = np.linspace(top, 0.0, _spans(upper, lower) + 1)
    return _mesh([ring(cup.section, float(z), chordal_error) for z in heights])


def plate_with_hole(hole: Section, length: float, width: float, chordal_error: float) -> Mesh:
    """The plate at z = 0, centred at the origin, with a hole; the normals point down.

    The hole's edge has the vertices of the top ring of `passage` for the same chordal error.

    Raises:
        InvalidDesign: if the hole does not fit into the plate.
    """
    _check_chordal_error(chordal_error)
    check_section(hole, "hole")
    for side, reach, limit in (
        ("length", abs(hole.shift) + hole.length / 2, length / 2),
        ("width", hole.width / 2, width / 2),
    ):
        if not reach < limit:
            raise InvalidDesign(
                f"plate {side} = {2e3 * limit:.4g} mm must exceed {2e3 * reach:.4g} mm to hold "
                f"the hole; increase the plate's {side}"
            )
    x, y = length / 2, width / 2
    rim = np.array([[x, y, 0.0], [-x, y, 0.0], [-x, -y, 0.0], [x, -y, 0.0]])
    outer = Ring(rim, np.array([1.0, 2.0, 3.0, 4.0]))
    return _mesh([outer, ring(hole, 0.0, chordal_error)])


def passage(loft: Loft, tube_end_z: float, chordal_error: float) -> Mesh:
    """Hopper and straight tube below it, open at top and bottom.

    Raises:
        InvalidDesign: if the loft cannot be built, or the tube would end inside the hopper.
    """
    _check_chordal_error(chordal_error)
    check_loft(loft)
    check_tube(loft, tube_end_z)
    outlet = float(loft.heights[-1])
    hopper = [ring(loft.section(z), z, chordal_error) for z in ring_heights(loft, chordal_error)]
    tube = loft.section(outlet)
    rings = _divided(hopper, loft, chordal_error)
    last = ring(tube, tube_end_z, chordal_error)
    spans = _spans(rings[-1], last)
    for z in np.linspace(outlet, tube_end_z, spans + 1)[1:]:
        rings.append(ring(tube, float(z), chordal_error))
    return _mesh(rings)


def ring_heights(loft: Loft, chordal_error: float) -> Array:
    """Heights (k,) [m] at which rings keep the hopper's mesh within `chordal_error` [m].

    Between rings the section is interpolated linearly. The spacing of the rings follows the
    curvature of the surface, so the error is about the same in each span (at most
    h^2/8 max|d2/dz2| over a span h). The number of rings follows from the error at sampled heights.
    """
    z = np.linspace(loft.heights[0], loft.heights[-1], SAMPLES)
    exact = loft.values(z)
    left = chordal_error - max(_ring_error(Section(*row), chordal_error) for row in exact.tolist())
    density = np.sqrt(_largest_offset(loft.values(z, derivative=2)) / (8 * left))  # [1/m]
    steps = (density[1:] + density[:-1]) / 2 * -np.diff(z)
    rank = np.concatenate(([0.0], np.cumsum(steps)))
    for spans in range(max(1, math.floor(rank[-1])), SAMPLES):
        heights = loft.heights[[0, -1]]
        if spans > 1:
            heights = np.interp(np.linspace(0, rank[-1], spans + 1), rank, z)
            heights[[0, -1]] = loft.heights[[0, -1]]
        ends = loft.values(heights).T
        linear = np.column_stack([np.interp(-z, -heights, quantity) for quantity in ends])
        if _largest_offset(exact - linear).max() <= left:
            return heights
    return z  # the finest spacing: the error of a cubic is below 1e-5 m over 1.3 mm


def _largest_offset(change: Array) -> Array:
    """How far a change of sections moves their outlines, over all normals' directions, (n,).

    The change of the support function s cos + (l/2 - r) |cos| + (w/2 - r) |sin| + r.

    Args:
        change: of length, width, radius, shift, (n, 4).
    """
    length, width, radius, shift = change.T[:, :, None]
    angle = np.linspace(0.0, math.pi / 2, 10)
    cosine, sine = np.cos(angle), np.sin(angle)
    even = (length / 2 - radius) * cosine + (width / 2 - radius) * sine + radius
    return np.asarray(np.max(np.abs(even) + np.abs(shift * cosine), axis=1))


def _ring_error(section: Section, chordal_error: float) -> float:
    """Distance between a ring and its section: sagitta, and half of each side closed up [m]."""
    shape = closed_up(section, chordal_error)
    lost = math.hypot(section.length - shape.length, section.width - shape.width) / 2
    return sagitta(section.radius, chordal_error) + lost


def _divided(rings: list[Ring], loft: Loft, chordal_error: float) -> list[Ring]:
    """The hopper's rings, and more rings where triangles would be too thin."""
    every = [rings[0]]
    for upper, lower in pairwise(rings):
        heights = np.linspace(upper.points[0, 2], lower.points[0, 2], _spans(upper, lower) + 1)
        inner = [float(z) for z in heights[1:-1]]
        every += [ring(loft.section(z), z, chordal_error) for z in inner]
        every.append(lower)
    return every


def _spans(upper: Ring, lower: Ring) -> int:
    """Number of equal spans between two rings that keeps triangles above `THINNEST`."""
    shortest = float(min(upper.edges.min(), lower.edges.min()))
    height = float(upper.points[0, 2] - lower.points[0, 2])
    return max(1, math.ceil(THINNEST * height / (math.sqrt(3) * shortest) - 1e-9))


def _mesh(rings: Sequence[Ring]) -> Mesh:
    """Strips between successive rings, from the top down."""
    starts = np.cumsum([0] + [len(r.points) for r in rings])
    parts = [strip(a, b) + starts[k] for k, (a, b) in enumerate(pairwise(rings))]
    return Mesh(np.vstack([r.points for r in rings]), np.vstack(parts))


def _check_chordal_error(chordal_error: float) -> None:
    if not 5e-5 <= chordal_error <= 0.01:
        raise ConfigError(
            f"chordal_error = {chordal_error:g} m must lie between 5e-05 and 0.01 m; "
            "0.0005 to 0.0015 m suits simulations"
        )
