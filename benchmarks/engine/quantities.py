"""What of a run is compared between engines: numbers, and distributions of passage times."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from benchmarks.engine.runs import Run
from fidelity.scenes.dosing.objectives import paper_dispersion
from mfopt.arrays import AnyArray, Array

Raw = Mapping[str, AnyArray]


@dataclass(frozen=True, slots=True)
class Quantity:
    """Something that a run tells."""

    name: str
    scene: str  # that tells it; `dosing` stands for all its designs
    unit: str
    number: Callable[[Raw], float]
    values: Callable[[Raw], Array] | None = None  # where a distribution is compared

    def of(self, run: Run) -> bool:
        """Whether the run tells it."""
        return run.scene.partition(":")[0] == self.scene


def _exit_times(raw: Raw) -> Array:
    return np.asarray(raw["exit_times"], float)


def _passage_times(raw: Raw) -> Array:
    return np.asarray(raw["passage_times"], float)


def _objective(raw: Raw) -> float:
    return sum(paper_dispersion(raw).values())


def _dispersion(raw: Raw) -> float:
    return paper_dispersion(raw)["dispersion"]


# Of a distribution the number is its mean.
QUANTITIES = (
    Quantity("discharge rate", "discharge", "kg/s", lambda raw: float(raw["mass_flow_rate"])),
    Quantity(
        "passage times", "discharge", "s", lambda raw: float(_exit_times(raw).mean()), _exit_times
    ),
    Quantity("heap angle", "heap", "deg", lambda raw: float(np.degrees(raw["angle"]))),
    Quantity("share of the weight on the walls", "silo", "-", lambda raw: float(raw["wall_share"])),
    Quantity("dosing objective", "dosing", "s", _objective),
    Quantity("objective without grains left", "dosing", "s", _dispersion),
    Quantity(
        "passage times",
        "dosing",
        "s",
        lambda raw: float(_passage_times(raw).mean()),
        _passage_times,
    ),
)
