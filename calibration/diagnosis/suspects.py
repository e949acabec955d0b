"""What may be missing: effects of the rig, which need runs, and effects of measuring, which do not.

The strength s of an effect goes from 0 (absent) to 1, or to -1 where both signs make sense. Its
parameter is null + s^2 (end - null): weak effects, which are the ones in doubt, are tried finely.
Of an effect with several parameters the first one varies, the others lie amid their ranges.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from mfopt.records.effect import Effect


@dataclass(frozen=True, slots=True)
class RigEffect:
    """An effect that a rig can switch on, by the names of parameters of the rig."""

    name: str
    varies: str  # parameter that has the strength
    null: float
    low: float
    high: float
    unit: str
    meaning: str
    beside: Mapping[str, float]  # further parameters where the effect is there

    @property
    def signed(self) -> bool:
        """Whether the parameter may lie on both sides of its null."""
        return self.low < self.null < self.high

    @property
    def absent(self) -> dict[str, float]:
        """Parameters without the effect."""
        return {self.varies: self.null, **self.beside}

    def at(self, strength: float) -> dict[str, float]:
        """Parameters at a strength."""
        upwards = self.high > self.null
        end = self.high if upwards and strength >= 0.0 else self.low
        value = self.null + strength**2 * (end - self.null)
        return {self.varies: min(max(value, self.low), self.high), **self.beside}

    def value(self, strength: float) -> float:
        """Value [unit] of the parameter that varies."""
        return self.at(strength)[self.varies]

    def strength(self, value: float) -> float:
        """Strength of a value of the parameter that varies."""
        upwards = value >= self.null
        end = self.high if upwards and self.high > self.null else self.low
        size = float(((value - self.null) / (end - self.null)) ** 0.5)
        return size if upwards or not self.signed else -size


def effect_of(its: Effect) -> RigEffect:
    """An effect of mfopt as one that can be suspected."""
    main = {name: p for name, p in its.parameters.items() if not p.shapes}
    (first, varies), *others = main.items()
    beside = {f"{its.name}.{name}": (p.low + p.high) / 2.0 for name, p in others}
    name = f"{its.name}.{first}" if others else its.name
    return RigEffect(
        its.name, name, varies.null, varies.low, varies.high, varies.unit, varies.meaning, beside
    )
