"""Numbers and units as a reader wants them; everywhere else SI units hold."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

LARGEST_SMALL = 10.0  # [s] or [m]: below it ms and mm read better, as on drawings
MISSING = "–"


@dataclass(frozen=True, slots=True)
class Display:
    """How a quantity is shown: its value times `factor`, in `unit`."""

    factor: float
    unit: str

    @property
    def bracket(self) -> str:
        """The unit as an axis label carries it."""
        return f"[{self.unit}]"

    def text(self, value: float | None, significant: int = 4) -> str:
        """The number alone, without its unit."""
        return number(None if value is None else value * self.factor, significant)

    def full(self, value: float | None, significant: int = 4) -> str:
        """The number with its unit."""
        shown = self.text(value, significant)
        return shown if self.unit == MISSING or shown == MISSING else f"{shown}\u202f{self.unit}"


def display(unit: str, values: ArrayLike) -> Display:
    """Choose how to show `values` [unit]; seconds and metres below 10 become ms and mm."""
    finite = np.abs(np.asarray(values, dtype=float))
    finite = finite[np.isfinite(finite)]
    small = finite.size == 0 or float(np.median(finite)) < LARGEST_SMALL
    if small and unit in ("s", "m"):
        return Display(1e3, f"m{unit}")
    if unit == "rad":
        return Display(180.0 / math.pi, "°")
    return Display(1.0, MISSING if unit in ("-", "") else unit)


def number(value: float | None, significant: int = 4) -> str:
    """A number to so many significant digits; never in exponents where it reads without.

    An infinite value belongs to a failed run and is called so.
    """
    if value is None or math.isnan(value):
        return MISSING
    if math.isinf(value):
        return "failed"
    if value == 0.0:
        return "0"
    magnitude = math.floor(math.log10(abs(value)))
    if not -4 <= magnitude < 7:
        return f"{value:.{significant - 1}e}".replace("-", "\u2212")
    decimals = max(0, significant - 1 - magnitude)
    rounded = f"{value:.{decimals}f}"
    if float(rounded) == 0.0:
        return "0"
    return rounded.replace("-", "\u2212")
