"""A tank that drains: a simulator with a closed form, two parameters and a noise of its own."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from mfopt.arrays import Array, frozen
from mfopt.errors import ConfigError
from mfopt.records.outcome import Outcome
from mfopt.records.rig import TIME, Channel, RigParameter

TIMES = np.linspace(0.0, 2.0, 81)
SCATTER = 0.01  # [m] of a whole run: its "packing"


def level_of(x: Array, start: float, times: Array = TIMES) -> Array:
    """Level [m]: the head falls as (sqrt(h) - rate t)^2; `sag` lowers it evenly."""
    rate, sag = x
    head = np.maximum(np.sqrt(start) - rate * times, 0.0) ** 2
    return np.asarray(head - sag * times)


@dataclass(frozen=True, slots=True)
class TankLevel:
    name: str
    start: float

    def work(self, x: Array) -> float:
        return 1.0

    def evaluate(self, x: Array, *, seed: int) -> Outcome:
        rng = np.random.default_rng(seed)
        slow = SCATTER * rng.normal() * np.sin(np.pi * TIMES / TIMES[-1])
        if rng.random() < 0.03:
            return Outcome(frozen(x), self.name, seed, "crashed", "it leaked")
        raw = {TIME: TIMES, "level": level_of(x, self.start) + slow}
        return Outcome(frozen(x), self.name, seed, "finished", None, raw, 1.0, 0.01)


@dataclass(frozen=True, slots=True)
class Tank:
    """Implements `calibration.rig.Rig`."""

    channels: ClassVar = {"level": Channel("level", "m", 1.0)}
    unsure: ClassVar[Mapping[str, tuple[float, float]]] = {}
    possible: ClassVar[Mapping[str, Mapping[str, float | str]]] = {}

    def parameter(self, name: str) -> RigParameter:
        known = {"rate": RigParameter(0.0, 1.0, "-", "of the head"),
                 "sag": RigParameter(0.0, 0.2, "m/s", "of the level")}  # fmt: skip
        if name not in known:
            raise ConfigError(f"there is no parameter {name!r}")
        return known[name]

    def level(
        self, name: str, conditions: Mapping[str, float | str], parameters: tuple[str, ...]
    ) -> TankLevel:
        return TankLevel(name, float(conditions["start"]))
