"""What a report shows of a design besides its numbers; filled in by whoever knows the machine."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from mfopt.arrays import Array, IntArray

Mesh = tuple[Array, IntArray]  # vertices (v, 3) [m], triangles (t, 3)


def _none() -> Array:
    return np.empty(0)


@dataclass(frozen=True, slots=True, eq=False)
class DesignView:
    """Shape, motion and bounds of one design, in the coordinates of the snapshots.

    x points along the motion, z up. Whatever is left empty, the report leaves out.
    """

    label: str
    x: Array  # (d,) physical units
    parts: Mapping[str, Mesh] = field(default_factory=dict)  # as they stand at time 0
    moving: frozenset[str] = frozenset({"cup"})  # parts that follow the motion
    motion_times: Array = field(default_factory=_none)  # (m,) [s], from 0
    cup_positions: Array = field(default_factory=_none)  # (m,) of its centre along x [m]
    cup_velocities: Array = field(default_factory=_none)  # (m,) [m/s]
    motion_points: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    # named points of the motion law: time [s], position [m]
    notes: tuple[str, ...] = ()  # manufacturability, one sentence each
    bound_s: float | None = None  # physical lower bound of the filling time with this motion [s]
    bound_any_s: float | None = None  # the same over all motions [s]
    grain_offsets: Array = field(default_factory=lambda: np.empty((0, 3)))  # (k, 3) [m], top level
    grain_radii: Array = field(default_factory=_none)  # (k,) [m], top level


Describe = Callable[[Array], DesignView | None]  # x (d,) -> its view, or None if there is none


def no_view(x: Array) -> None:
    """Describes no design: what a report shows where nobody knows the machine."""
