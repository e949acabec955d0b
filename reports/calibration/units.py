"""How values of a calibration are shown: units that fit their size, names in words."""

import math
from collections.abc import Iterable

import numpy as np

from mfopt.records.calibration import Found
from reports.units import Display, fixed, number

WITHOUT = Display(1.0, "")  # of a pure number
LONG = 1e5  # numbers from here on, or below the inverse, have an exponent


def shown(unit: str, values: Iterable[float]) -> Display:
    """The unit in which the largest of `values` [unit] reads best; none for pure numbers."""
    largest = float(np.max(np.abs(list(values)), initial=0.0))
    if unit in ("m", "s", "kg") and largest < 1.0:
        return Display(1e3, "g" if unit == "kg" else f"m{unit}")
    if unit == "Pa" and largest >= LONG:
        return Display(1e-6, "MPa")
    if unit == "rad":
        return Display(math.degrees(1.0), "°")
    return WITHOUT if unit in ("-", "") else Display(1.0, unit)


def words(name: str) -> str:
    """The name of a channel as one says it."""
    return name.replace("_", " ")


def label(name: str, its: Display) -> str:
    """A name with its unit, as axes and heads of tables carry it."""
    return f"{name} {its.bracket}" if its.unit else name


def of_parameter(its: Found) -> Display:
    """How the values of a parameter are shown."""
    return shown(its.unit, [its.high])


def resolved(value: float, its: Found) -> str:
    """A value of a parameter to the digits that its interval justifies: two of the width."""
    unit = of_parameter(its)
    scaled, step = value * unit.factor, (its.interval[1] - its.interval[0]) * unit.factor
    if its.log:
        return number(scaled, 2)
    if not (step > 0.0 and math.isfinite(step)) or not 1.0 / LONG < abs(scaled) < LONG:
        return number(scaled, 3)
    return fixed(scaled, max(0, 1 - math.floor(math.log10(step))))


def with_unit(text: str, its: Display) -> str:
    """A number with its unit."""
    return f"{text}\u202f{its.unit}" if its.unit else text
