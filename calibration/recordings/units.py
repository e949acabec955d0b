"""Units that a recording may have, and what they are in SI units."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

DEGREE = math.pi / 180.0

# Unit as it should be written -> factor to the SI unit, SI unit.
UNITS: Mapping[str, tuple[float, str]] = {
    **{name: (1.0, "s") for name in ("s", "sec", "second", "seconds")},
    **{"ms": (1e-3, "s"), "us": (1e-6, "s"), "min": (60.0, "s"), "h": (3600.0, "s")},
    **{"m": (1.0, "m"), "cm": (1e-2, "m"), "mm": (1e-3, "m"), "um": (1e-6, "m")},
    **{"kg": (1.0, "kg"), "g": (1e-3, "kg"), "mg": (1e-6, "kg"), "t": (1e3, "kg")},
    **{name: (1.0, "-") for name in ("-", "1")},
    **{name: (1e-2, "-") for name in ("%", "pct", "percent")},
    **{"rad": (1.0, "rad"), "deg": (DEGREE, "rad"), "°": (DEGREE, "rad")},
    **{"kg/s": (1.0, "kg/s"), "g/s": (1e-3, "kg/s"), "mg/s": (1e-6, "kg/s")},
    **{"kg/min": (1.0 / 60.0, "kg/s"), "g/min": (1e-3 / 60.0, "kg/s")},
    **{"kg/h": (1.0 / 3600.0, "kg/s"), "t/h": (1.0 / 3.6, "kg/s")},
    **{"m/s": (1.0, "m/s"), "mps": (1.0, "m/s"), "cm/s": (1e-2, "m/s"), "mm/s": (1e-3, "m/s")},
    **{"rad/s": (1.0, "rad/s"), "deg/s": (DEGREE, "rad/s"), "rpm": (math.pi / 30.0, "rad/s")},
    **{"m/s2": (1.0, "m/s2"), "kg/m3": (1.0, "kg/m3"), "g/l": (1.0, "kg/m3")},
    **{name: (1e3, "kg/m3") for name in ("g/cm3", "g/ml", "kg/l", "t/m3")},
    **{"m3": (1.0, "m3"), "l": (1e-3, "m3"), "ml": (1e-6, "m3"), "cm3": (1e-6, "m3")},
    **{"m2": (1.0, "m2"), "cm2": (1e-4, "m2"), "mm2": (1e-6, "m2")},
    **{"N": (1.0, "N"), "kN": (1e3, "N")},
    **{"Pa": (1.0, "Pa"), "kPa": (1e3, "Pa"), "MPa": (1e6, "Pa")},
    **{"K": (1.0, "K"), "degC": (1.0, "degC"), "V": (1.0, "V")},
    **{"A": (1.0, "A"), "J": (1.0, "J"), "W": (1.0, "W")},
    **{"Hz": (1.0, "Hz"), "1/s": (1.0, "Hz"), "kHz": (1e3, "Hz")},
}
LIKELY = 5.0  # a likely unit brings a value so near to what is typical
FRAMES = ("frame", "frames")  # of time; a case file says how many make a second

# Capitals do not matter, but where they tell milli from mega.
_ANY_CASE = {name.lower(): known for name, known in UNITS.items()}
_OTHER_PREFIX = frozenset(("Ms", "Mm", "Mm/s", "Mm2", "Mg", "Mg/s", "Ml", "mPa"))

_SPELLING = str.maketrans({"²": "2", "³": "3", "^": "", "µ": "u", "μ": "u"})


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit as it was written, and what it means."""

    written: str
    factor: float  # value in SI = factor x value as written
    si: str


def unit_of(text: str) -> Unit | None:
    """The unit that a text names; None if there is no such unit."""
    written = text.strip()
    plain = written.translate(_SPELLING)
    known = None if plain in _OTHER_PREFIX else _ANY_CASE.get(plain.lower())
    return None if known is None else Unit(written, *known)


def si_units() -> list[str]:
    """All SI units that a channel may have."""
    return list(dict.fromkeys(si for _, si in UNITS.values()))


def units_like(si: str) -> list[str]:
    """All ways to write a unit of the same kind, for messages."""
    return [name for name, (_, base) in UNITS.items() if base == si]


def likely_unit(size: float, typical: float, si: str) -> Unit | None:
    """The unit in which a number of this size is nearest to what is typical.

    Args:
        size: the number as it is written, at least 0.
        typical: what it should be [si].
        si: the SI unit.
    """
    off = {
        name: abs(math.log(factor * size / typical))
        for name, (factor, base) in UNITS.items()
        if base == si and size > 0.0
    }
    best = min(off, key=lambda name: off[name], default=None)
    return unit_of(best) if best is not None and off[best] < math.log(LIKELY) else None
