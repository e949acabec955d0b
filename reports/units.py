"""Numbers and units for readers; all other modules use SI units."""

import math
import sys
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from reports.statistics import median

LARGEST_SMALL = 10.0  # [s] or [m]: below it ms and mm read better, as on drawings
LARGEST = sys.float_info.max_10_exp
LONGEST = 7  # digits before the point without an exponent
READABLE = 10.0**LONGEST  # below it, and above its inverse, a number reads without an exponent
FAILED = "failed"
MISSING = "\u2013"  # en dash
MINUS = "\u2212"
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
        """The number without the unit; infinity means a failed run."""
        if value is None:
            return MISSING
        if math.isinf(value):
            return FAILED
        shown = value * self.factor
        if not math.isfinite(shown):
            return number(shown)
        return number(shown, significant) if self.decimals is None else fixed(shown, self.decimals)

    def full(self, value: float | None, significant: int = 4) -> str:
        """The number with its unit."""
        shown = self.text(value, significant)
        return shown if self.unit == MISSING or shown == MISSING else f"{shown}\u202f{self.unit}"


def display(unit: str, values: ArrayLike) -> Display:
    """Choose how to show `values` [unit]; seconds and metres below 10 become ms and mm."""
    finite = np.abs(np.asarray(values, dtype=float))
    finite = finite[np.isfinite(finite)]
    small = finite.size == 0 or median(finite) < LARGEST_SMALL
    if small and unit in ("s", "m"):
        return Display(1e3, f"m{unit}")
    if unit == "rad":
        return Display(180.0 / math.pi, "°")
    return Display(1.0, MISSING if unit in ("-", "") else unit)


def number(value: float | None, significant: int = 4, longest: int = LONGEST) -> str:
    """A number to so many significant digits; with an exponent only if it is needed.

    Args:
        value: infinite if it is beyond all numbers, None or nan if there is none.
        significant: digits.
        longest: number of digits before the point without an exponent.
    """
    if value is None or math.isnan(value):
        return MISSING
    if math.isinf(value):
        return f"{MINUS * (value < 0.0)}over 10{_power(LARGEST)}"
    if value == 0.0:
        return "0"
    mantissa, _, exponent = f"{value:.{significant - 1}e}".partition("e")
    magnitude = int(exponent)
    if not -4 <= magnitude < longest:
        return f"{mantissa.replace('-', MINUS)}\u00b710{_power(magnitude)}"
    return fixed(value, max(0, significant - 1 - magnitude))


def _power(exponent: int) -> str:
    return str(exponent).translate(SUPERSCRIPT)


def fixed(value: float, decimals: int) -> str:
    """A number to so many decimals, with a true minus and no negative zero."""
    rounded = f"{value:.{decimals}f}"
    return rounded.lstrip("-") if float(rounded) == 0.0 else rounded.replace("-", MINUS)


def design_display(unit: str, lower: float, upper: float) -> Display:
    """How a design variable is shown: decimals that resolve a thousandth of its range.

    If there would be too many decimals to read, the usual significant digits.
    """
    shown = display(unit, [lower, upper])
    width = (upper - lower) * shown.factor
    largest = max(abs(lower), abs(upper)) * shown.factor
    if not (width > 1.0 / READABLE and largest < READABLE):
        return shown
    return replace(shown, decimals=max(0, math.floor(3.0 - math.log10(width))))
