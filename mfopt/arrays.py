"""Arrays as the records keep them: float64 and read-only."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
AnyArray = NDArray[Any]

LARGEST = 1e50  # objective value that can still be squared after an output transform


def frozen(values: ArrayLike) -> Array:
    """Return a read-only float64 copy of `values`."""
    array = np.array(values, dtype=np.float64)
    array.flags.writeable = False
    return array


def capped(values: ArrayLike) -> Array:
    """Values that calculations can square: finite ones beyond +-1e50 count as that.

    Such a penalty is worse than everything else all the same. Infinite values stay, nan too.
    """
    array = np.array(values, dtype=np.float64)
    return np.where(np.isfinite(array), np.clip(array, -LARGEST, LARGEST), array)


def distinct(designs: Sequence[Array]) -> list[Array]:
    """The designs (d,) without repetitions, in order."""
    return list({x.tobytes(): x for x in designs}.values())
