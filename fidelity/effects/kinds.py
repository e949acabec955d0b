"""The two kinds of effects: on grains before they fill a vessel, and on what an engine is given."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from fidelity.engine import Setup
from fidelity.grains.filling import Portion
from mfopt.records.effect import Effect

Values = Mapping[str, float]


@dataclass(frozen=True, slots=True)
class PortionEffect:
    """An effect on the grains themselves: it is there before they fill a vessel."""

    effect: Effect
    engines: tuple[str, ...]  # families of engines that have it
    change: Callable[[Portion, Values], Portion]


@dataclass(frozen=True, slots=True)
class SetupEffect:
    """An effect on what an engine is given."""

    effect: Effect
    engines: tuple[str, ...]  # families of engines that have it
    change: Callable[[Setup, Values], Setup]
    fills: bool = True  # False: it is absent while the vessel is filled
