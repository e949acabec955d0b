"""Numbers and units as a reader wants them; everywhere else SI units hold."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

LARGEST_SMALL = 10.0  # [s] or [m]: below it ms and mm read better, as on drawings
MISSING = "\u2013"  # en dash
SUPERSCRIPT = str.maketrans(
    "0123456789-", "\u2070\u00b9\u00b2\u00b3\u2074\u2075\u2076\u2077\u2078\u2079\u207b"
)


@dataclass(frozen=True, slots=True)
class Display:
    """How a quantity is shown: its value times `factor`, in `unit`."""

    factor: float
    unit: str
    decimals: int | None = None  # fixed, or None: to so many significant digits

    @property
    def bracket(self) -> str:
        """The unit as an axis label carries it."""
        return f"[{self.unit}]"

    def text(self, value: float | None, significant: int = 4) -> str:
        """The number alone, without its unit."""
        if value is not None and self.decimals is not None and math.isfinite(value):
            return fixed(value * self.factor, self.decimals)
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
    rounded = float(f"{value:.{significant - 1}e}")  # 9.9999 has the magnitude of 10
    magnitude = math.floor(math.log10(abs(rounded)))
    if not -4 <= magnitude < 7:
        power = str(magnitude).translate(SUPERSCRIPT)
        return f"{fixed(value / 10.0**magnitude, significant - 1)}\u00b710{power}"
    return fixed(value, max(0, significant - 1 - magnitude))


def fixed(value: float, decimals: int) -> str:
    """A number to so many decimals, with a true minus and no negative zero."""
    rounded = f"{value:.{decimals}f}"
    return rounded.lstrip("-") if float(rounded) == 0.0 else rounded.replace("-", "\u2212")


def design_display(unit: str, lower: float, upper: float) -> Display:
    """How a design variable is shown: decimals that resolve a thousandth of its range."""
    shown = display(unit, [lower, upper])
    decimals = math.floor(3.0 - math.log10((upper - lower) * shown.factor))
    return replace(shown, decimals=max(0, decimals))
