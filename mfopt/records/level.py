"""Levels of fidelity, and the ladder that orders them."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

from mfopt.arrays import Array
from mfopt.errors import ConfigError
from mfopt.records.outcome import Outcome


class Level(Protocol):
    """One level of simulation, from analytic estimate to full DEM. Must be picklable."""

    @property
    def name(self) -> str:
        """Name, unique within a ladder."""

    def work(self, x: Array) -> float:
        """Predict the work of `evaluate(x)` [sphere-steps times the engine's cost factor]."""

    def evaluate(self, x: Array, *, seed: int) -> Outcome:
        """Run once at `x` (d,) in physical units. A failed run is returned, not raised."""


@dataclass(frozen=True, slots=True)
class Ladder:
    """Levels from coarse to fine; the last one is the target."""

    levels: tuple[Level, ...]

    def __post_init__(self) -> None:
        names = [level.name for level in self.levels]
        if not names:
            raise ConfigError("the ladder is empty: give at least one level")
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise ConfigError(f"level names must differ; {repeated[0]!r} occurs more than once")

    def __iter__(self) -> Iterator[Level]:
        return iter(self.levels)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the levels, coarse to fine."""
        return tuple(level.name for level in self.levels)

    @property
    def top(self) -> Level:
        """The target level."""
        return self.levels[-1]

    def __getitem__(self, name: str) -> Level:
        for level in self.levels:
            if level.name == name:
                return level
        raise ConfigError(f"unknown level {name!r}; the ladder has {', '.join(self.names)}")
