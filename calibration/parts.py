"""The errors that a fit allows for, by name."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

from mfopt.errors import ConfigError

# The engine `numba` differs from YADE by up to 0.5 of the scatter of one run: `docs/engine`.
ALLOWANCE = 0.4  # [scatters of one run]


@dataclass(frozen=True, slots=True)
class Parts:
    """Which errors count."""

    packing: bool = True
    measurement: bool = True
    emulator: bool = True
    constant: bool = True  # zero and scale
    clock: bool = True
    allowance: float = ALLOWANCE  # [scatters of one run]; 0: none


EVERY_PART = Parts()
ERRORS = tuple(f.name for f in fields(Parts))


def parts_without(names: Sequence[str]) -> Parts:
    """Every error but these.

    Raises:
        ConfigError: if there is no such error.
    """
    for name in names:
        if name not in ERRORS:
            raise ConfigError(f"there is no error {name!r}; choose from {', '.join(ERRORS)}")
    kept = {name: name not in names for name in ERRORS}
    allowance = ALLOWANCE if kept.pop("allowance") else 0.0
    return Parts(**kept, allowance=allowance)
