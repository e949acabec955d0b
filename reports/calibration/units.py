"""How values of a calibration are shown: in the units of the case file, with the digits that count.

Terminal, warnings and case file have the same units. So no value of a page is converted.
"""

import math
import re

from mfopt.records.calibration import Found
from reports.units import MINUS, SUPERSCRIPT, fixed, number

LONG = 5  # digits before the point; numbers with more have an exponent
EXPONENT = re.compile(r"(?<=\d)e\+?(-?)0*(?=\d)(\d+)\b")  # as computers write it


def words(name: str) -> str:
    """The name of a channel as one says it."""
    return name.replace("_", " ")


def label(name: str, unit: str) -> str:
    """A name with its unit, as axes and heads of tables carry it."""
    return f"{name} [{unit}]" if unit not in ("-", "") else name


def with_unit(text: str, unit: str) -> str:
    """A number with its unit; a pure number, whose unit is "-", stands alone."""
    return f"{text}\u202f{unit}" if unit not in ("-", "") else text


def brief(value: float, significant: int = 2) -> str:
    """A number to so many significant digits."""
    return number(value, significant, LONG)


def powers(text: str) -> str:
    """The text with its exponents as powers of ten."""
    return EXPONENT.sub(lambda its: f"\u00b710{(its[1] + its[2]).translate(SUPERSCRIPT)}", text)


def tick(value: float, _: float = 0.0) -> str:
    """A round number of an axis."""
    return powers(f"{value:g}").replace("-", MINUS)


def resolved(value: float, its: Found) -> str:
    """A value of a parameter to the digits that its interval justifies: two of the width."""
    step = its.interval[1] - its.interval[0]
    if its.log:
        return brief(value)
    if not (step > 0.0 and math.isfinite(step)) or not 10.0**-LONG < abs(value) < 10.0**LONG:
        return brief(value, 3)
    return fixed(value, max(0, 1 - math.floor(math.log10(step))))
