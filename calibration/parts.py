"""The errors that a fit allows for, by name."""

from dataclasses import dataclass, fields, replace

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
    allowance: bool = True  # for the difference between engine and reality


EVERY_PART = Parts()
ERRORS = tuple(f.name for f in fields(Parts))


def without(error: str) -> Parts:
    """Every error but this.

    Raises:
        ConfigError: if there is no such error.
    """
    if error not in ERRORS:
        raise ConfigError(f"there is no error {error!r}; choose from {', '.join(ERRORS)}")
    return replace(EVERY_PART, **{error: False})
