"""Motion of the cup over the hole: normalised position over normalised time.

A cubic from (0, 0) to P1, a straight line from P1 to P2, a cubic from P2 to (1, 1). Both
ends have the slope v, so cycles join without a jump in velocity. At P1 and P2 the cubics have the
slope of the line, so the velocity is continuous everywhere.

Source: section 1.3 of the paper (motion transfer function, figure 4).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial import polynomial

from geometry.loft import extremal_depths
from mfopt.arrays import Array, frozen
from mfopt.errors import ConfigError, InvalidDesign


@dataclass(frozen=True)
class MotionLaw:
    """Position of the cup, 0 at the start and 1 at the end of its stroke, over a cycle 0..1.

    The cup may move back (y2 < y1) and may leave 0..1 on the way: see `range`.
    """

    x1: float  # time of P1
    y1: float  # position at P1
    x2: float  # time of P2
    y2: float  # position at P2
    v: float  # velocity at both ends [strokes per cycle]

    def __post_init__(self) -> None:
        if not all(np.isfinite([self.x1, self.y1, self.x2, self.y2, self.v])):
            raise InvalidDesign(f"motion: {self} must have finite numbers only")
        if not 0 < self.x1 < self.x2 < 1:
            raise InvalidDesign(
                f"motion: x1 = {self.x1:.4g} and x2 = {self.x2:.4g} must satisfy 0 < x1 < x2 < 1; "
                "P1 comes before P2 in time"
            )

    @cached_property
    def pieces(self) -> tuple[tuple[float, float, Array], ...]:
        """(start, end, cubic in time since start, coefficients (4,) of powers 0..3)."""
        x1, y1, x2, y2, v = self.x1, self.y1, self.x2, self.y2, self.v
        slope = (y2 - y1) / (x2 - x1)
        return (
            (0.0, x1, _hermite(0.0, v, y1, slope, x1)),
            (x1, x2, frozen([y1, slope, 0.0, 0.0])),
            (x2, 1.0, _hermite(y2, slope, 1.0, v, 1 - x2)),
        )

    def position(self, t: Array | float) -> Array:
        """Position at the times `t` in 0..1 (any shape)."""
        return self._evaluated(t, 0)

    def velocity(self, t: Array | float) -> Array:
        """Velocity at the times `t` in 0..1 [strokes per cycle]."""
        return self._evaluated(t, 1)

    def acceleration(self, t: Array | float) -> Array:
        """Acceleration at the times `t` in 0..1 [strokes per cycle squared].

        The acceleration jumps at P1 and P2. The value there is the value just after: 0 at P1, the
        second cubic's at P2.
        """
        return self._evaluated(t, 2)

    def range(self) -> tuple[float, float]:
        """Smallest and largest position of the cup in a cycle."""
        positions = [
            polynomial.polyval(extremal_depths(cubic, end - start), cubic)
            for start, end, cubic in self.pieces
        ]
        every = np.concatenate(positions)
        return float(every.min()), float(every.max())

    def _evaluated(self, t: Array | float, derivative: int) -> Array:
        times = np.asarray(t, dtype=np.float64)
        if not np.all((times >= -1e-9) & (times <= 1 + 1e-9)):
            raise ConfigError(
                f"motion: time {times.min():.4g} to {times.max():.4g} must lie in 0..1; "
                "divide by the cycle time"
            )
        (_, _, first), (_, _, line), (_, _, last) = (
            (start, end, polynomial.polyder(cubic, derivative)) for start, end, cubic in self.pieces
        )
        early = polynomial.polyval(times, first)
        middle = polynomial.polyval(times - self.x1, line)
        late = polynomial.polyval(times - self.x2, last)
        value = np.where(times < self.x1, early, np.where(times < self.x2, middle, late))
        return np.asarray(value)


def _hermite(start: float, start_slope: float, end: float, end_slope: float, span: float) -> Array:
    """Cubic (4,) in powers of t that has the given values and slopes at t = 0 and `span`."""
    mean_slope = (end - start) / span
    return frozen([
        start,
        start_slope,
        (3 * mean_slope - 2 * start_slope - end_slope) / span,
        (start_slope + end_slope - 2 * mean_slope) / span**2,
    ])  # fmt: skip
