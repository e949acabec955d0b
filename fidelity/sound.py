"""Checks of what engines are given and give back, the same for all of them."""

from collections.abc import Sequence

import numpy as np

from mfopt.arrays import AnyArray
from mfopt.errors import ConfigError


def require_numbers(
    what: str, values: AnyArray, shape: Sequence[int | None], *, above: float | None = None
) -> None:
    """Require an array of finite numbers.

    Args:
        what: what it is, for the message.
        values: the array.
        shape: of each axis; None: any length.
        above: what all of them must exceed.

    Raises:
        ConfigError: if it is not.
    """
    given = np.shape(values)
    fits = len(given) == len(shape) and all(
        w in (None, g) for g, w in zip(given, shape, strict=True)
    )
    if not fits:
        wanted = ", ".join("any" if n is None else str(n) for n in shape)
        raise ConfigError(f"{what}: shape {given} must be ({wanted})")
    if not np.isfinite(values).all():
        first = tuple(int(i) for i in np.argwhere(~np.isfinite(values))[0])
        raise ConfigError(f"{what}: entry {first} is not a finite number; give finite numbers")
    if above is not None and not (np.asarray(values) > above).all():
        raise ConfigError(f"{what}: smallest {np.min(values):g} must be above {above:g}")
