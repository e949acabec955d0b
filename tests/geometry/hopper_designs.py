"""Hoppers that several tests share."""

import numpy as np

from geometry.loft import Loft
from geometry.sections import Section

HEIGHTS = (0.0, -0.08, -0.18, -0.26)
TUBE_END = -0.56
HOLE = Section(0.15, 0.115, 0.025, 0.0)
TUBE = Section(0.095, 0.07, 0.025, 0.0)
# Bounds of length, width, radius, shift of the sections 1 and 2 [m].
BOUNDS = (
    ((0.08, 0.18), (0.06, 0.14), (0.005, 0.045), (-0.04, 0.04)),
    ((0.07, 0.15), (0.05, 0.12), (0.005, 0.04), (-0.03, 0.03)),
)
# Wide above, narrow and shifted below; curved everywhere.
CURVED = Loft(
    HEIGHTS, (HOLE, Section(0.17, 0.13, 0.04, 0.03), Section(0.09, 0.08, 0.015, -0.02), TUBE)
)
# The sides close up where the radius is half of them, at the first section only.
TOUCHING = Loft(
    HEIGHTS,
    (
        Section(0.08, 0.08, 0.04, 0.0),
        Section(0.11, 0.1, 0.04, 0.0),
        Section(0.11, 0.11, 0.04, 0.0),
        Section(0.095, 0.09, 0.025, 0.0),
    ),
)


def straight() -> Loft:
    """The sections on straight lines from hole to tube (the baseline design)."""
    ends = np.array([(s.length, s.width, s.radius, s.shift) for s in (HOLE, TUBE)])
    parts = [z / HEIGHTS[-1] for z in HEIGHTS]
    return Loft(HEIGHTS, tuple(Section(*(ends[0] * (1 - t) + ends[1] * t)) for t in parts))


def prism(section: Section) -> Loft:
    """All sections equal."""
    return Loft(HEIGHTS, (section,) * 4)


def drawn(rng: np.random.Generator) -> Loft:
    """A random design, valid or not."""
    free = [Section(*(rng.uniform(*bound) for bound in bounds)) for bounds in BOUNDS]
    return Loft(HEIGHTS, (HOLE, *free, TUBE))
