"""Sizes of the grains of a portion that are not all alike. The portion's mass stays."""

from dataclasses import dataclass

import numpy as np

from mfopt.arrays import Array, frozen
from mfopt.errors import ConfigError

# Smaller grains slip between the others, and need too short a time step.
SMALLEST_RATIO = 0.1


@dataclass(frozen=True, slots=True)
class Sizes:
    """How the sizes of grains of one shape differ."""

    scatter: float = 0.0  # [-] half width of an even distribution around 1
    small_share: float = 0.0  # [-] of the grains, by number, that are small
    small_ratio: float = 1.0  # [-] size of these over that of the others

    def __post_init__(self) -> None:
        if not 0.0 <= self.scatter < 1.0:
            raise ConfigError(
                f"scatter = {self.scatter:g} of sizes must be at least 0 and below 1; 0.05 is +-5 %"
            )
        if not 0.0 <= self.small_share <= 1.0:
            raise ConfigError(f"small_share = {self.small_share:g} must lie in 0 to 1")
        if not SMALLEST_RATIO <= self.small_ratio <= 1.0:
            raise ConfigError(
                f"small_ratio = {self.small_ratio:g} must be at least {SMALLEST_RATIO:g} and at "
                "most 1; 1 is equal size"
            )


EQUAL = Sizes()


def drawn(sizes: Sizes, grains: int, seed: int) -> Array | None:
    """Scales (n,) of the grains, the mean of their cubes 1; None where all are alike.

    A share of small grains is rounded to whole grains.
    """
    small = round(sizes.small_share * grains)
    two = 0 < small < grains and sizes.small_ratio < 1.0
    if sizes.scatter == 0.0 and not two:
        return None
    rng = np.random.default_rng([seed, 1])  # another stream than that of the places
    scales = rng.uniform(1.0 - sizes.scatter, 1.0 + sizes.scatter, grains)
    if two:
        scales[rng.permutation(grains)[:small]] *= sizes.small_ratio
    return frozen(scales / np.cbrt(np.mean(scales**3)))
