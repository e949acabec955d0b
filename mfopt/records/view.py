"""What a report shows of a design besides its numbers; filled in by whoever knows the machine."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from mfopt.arrays import Array, IntArray

Colour = tuple[float, float, float]  # red, green and blue, 0..1
Mesh = tuple[Array, IntArray]  # vertices (v, 3) [m], triangles (t, 3)


def _none() -> Array:
    return np.empty(0)


@dataclass(frozen=True, slots=True, eq=False)
class DesignView:
    """Shape, motion and bounds of one design, in the coordinates of the snapshots.

    z points up. Whatever is left empty, the report leaves out.
    """

    x: Array  # (d,) physical units
    label: str = ""
    parts: Mapping[str, Mesh] = field(default_factory=dict)  # as they stand at time 0
    colours: Mapping[str, Colour] = field(default_factory=dict)  # of parts; others are grey
    translucent: Mapping[str, float] = field(default_factory=dict)  # parts that would hide others
    backdrop: frozenset[str] = frozenset()  # parts that may run out of the picture
    moving: frozenset[str] = frozenset()  # parts that follow the motion
    mover: str = ""  # what moves, in a word
    motion_times: Array = field(default_factory=_none)  # (m,) [s], from 0
    motion_positions: Array = field(default_factory=_none)  # (m,) of the moving part [m]
    motion_velocities: Array = field(default_factory=_none)  # (m,) [m/s]
    upwards: bool = False  # the motion is along z instead of x
    motion_points: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    # named points of the motion law: time [s], position [m]
    notes: tuple[str, ...] = ()  # manufacturability, one sentence each
    bound: float | None = None  # physical lower bound of the quantity beside the objective, SI
    bound_any: float | None = None  # the same over all designs
    bound_note: str = ""  # what the bounds say, a sentence
    counted_at: str = "the outlet"  # where passing grains are counted, in words
    clock: str = "the start of the run"  # what time is counted from, in words
    grain_offsets: Array = field(default_factory=lambda: np.empty((0, 3)))  # (k, 3) [m], top level
    grain_radii: Array = field(default_factory=_none)  # (k,) [m], top level


Describe = Callable[[Array], DesignView | None]  # x (d,) -> its view, or None if there is none


def no_view(x: Array) -> None:
    """Describes no design: what a report shows where nobody knows the machine."""
