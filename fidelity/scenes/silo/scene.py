"""The slender silo as a scene."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from pydantic import Field

from fidelity.engine import Movement, Packing, Setup
from fidelity.grains.filling import filling_time, plane, rectangle, strip
from fidelity.grains.settings import MILLI, DemSettings
from fidelity.scene import Cycle, raw_of
from fidelity.scenes.beads import Vessel, VesselScene, checked_design, problem_of
from fidelity.scenes.silo.run import (
    FLOOR,
    SNAPSHOTS,
    WALL_FORCES,
    SiloSettings,
    check_silo,
    silo_load,
    silo_setup,
)
from geometry.mesh import Mesh
from mfopt.arrays import AnyArray, Array, frozen
from mfopt.limits import Bounds, Kilograms, Millimetres, Milliseconds
from mfopt.records.objective import Criteria, Objective, Quantity, Raw
from mfopt.records.problem import Problem
from mfopt.settings import Settings

WORK_SHARE = 1.0  # all spheres stay
LOOSE = 0.35  # solid share of the grains before they fall, to predict how long they do
POURED = 0.55  # and after it


class Box(Vessel):
    """A box of square section on a floor."""

    units: ClassVar[Mapping[str, str]] = {"width": "mm"}
    usual_step: ClassVar[float | None] = 0.6  # at larger steps the resting grains tremble

    width_mm: Millimetres = 60
    rest_ms: Milliseconds = 100  # after the time in which the grains come to rest
    portion_kg: Kilograms = 1.0
    free: dict[str, Bounds] = Field(default_factory=lambda: {"width": (40.0, 100.0)}, min_length=1)

    def all_values(self) -> dict[str, float]:
        """Value of every measure that can be free [mm]."""
        return {"width": self.width_mm}


def built(settings: Box, x: Array) -> SiloSettings:
    """The silo of the design `x` (d,) [mm].

    Raises:
        InvalidDesign: if it cannot be built.
    """
    silo = SiloSettings(MILLI * settings.values_at(x)["width"], MILLI * settings.rest_ms)
    checked_design(lambda: check_silo(silo))
    return silo


class Wanted(Settings):
    """Nothing can be said of the objective."""


def _floor_share(raw: Raw) -> float:
    """Share of the grains' weight that the floor carries."""
    return float(raw["floor_share"])


def _wall_share(raw: Raw) -> float:
    """Share of the grains' weight that the side walls carry."""
    return float(raw["wall_share"])


@dataclass(frozen=True, slots=True)
class Silo(VesselScene):
    """Grains in a slender box, whose walls carry a part of them. Implements the scene protocol."""

    name: ClassVar[str] = "silo"

    settings: Box = field(default_factory=Box)
    wanted: Wanted = field(default_factory=Wanted)

    def problem(self) -> Problem:
        """The free measures."""
        return problem_of(self.settings, built)

    def criteria(self) -> Criteria:
        """What floor and walls carry."""
        return Criteria(
            {"floor_load": Objective("floor_load", lambda raw: {"floor": _floor_share(raw)})},
            (
                Quantity("weight on the floor", "-", _floor_share, (1e2, "%")),
                Quantity(
                    "weight on the walls", "-", _wall_share, (1e2, "%"), lower_is_better=False
                ),
            ),
            "weight on the walls",
        )

    def cycle(self, x: Array) -> Cycle:
        """Fall and rest."""
        portion = self.portion(x, DemSettings(grains=1000, spheres_per_grain=1))
        fall = filling_time(portion, self._height(x, LOOSE))
        return Cycle(fall + MILLI * self.settings.rest_ms, WORK_SHARE)

    def filling(self, x: Array, dem: DemSettings, seed: int) -> None:
        """Filling is a part of the run, so that the friction of the walls is that of filling."""

    def setup(
        self, x: Array, dem: DemSettings, packing: Packing | None, seed: int, moments: int
    ) -> Setup:
        """Loose grains above the floor; `moments` pictures, the last one at rest."""
        setup = silo_setup(built(self.settings, x), self.portion(x, dem), seed)
        at_rest = float(setup.snapshot_times[0]) * (1.0 - 1e-3)  # just before forces are averaged
        pictures = np.linspace(0.0, at_rest, moments + 1)[1:]
        return replace(setup, snapshot_times=frozen([*pictures, *setup.snapshot_times]))

    def results(
        self, x: Array, dem: DemSettings, setup: Setup, movement: Movement, seed: int
    ) -> tuple[dict[str, AnyArray], str | None]:
        """What floor and walls carry at rest."""
        at_rest = {name: taken[-SNAPSHOTS:] for name, taken in movement.snapshots.items()}
        told = silo_load(setup, replace(movement, snapshots=at_rest))
        values = {
            "wall_share": told.wall_share, "floor_share": told.floor_share,
            "shares": told.shares, "fill_height": told.fill_height,
        }  # fmt: skip
        pictures = len(setup.snapshot_times) - SNAPSHOTS
        shown = {
            name: taken[:pictures]
            for name, taken in movement.snapshots.items()
            if pictures > 0 and name != WALL_FORCES
        }
        return raw_of(values, setup, replace(movement, snapshots=shown)), None

    def meshes(self, x: Array) -> Mapping[str, Mesh]:
        """The floor, and the side walls as high as the grains stand."""
        width, height = built(self.settings, x).width, self._height(x, POURED)
        corners = np.array(rectangle(width, width, 0.0) + rectangle(width, width, height))
        sides = Mesh(corners, np.array(strip(np.arange(4), np.arange(4, 8))))
        return {"sides": sides, FLOOR: plane(width, width, 0.0)}

    def _height(self, x: Array, solid: float) -> float:
        """Height [m] that the grains fill, at a solid share."""
        its = self.settings
        return its.portion_kg / its.grain.density_kg_m3 / solid / built(self.settings, x).width ** 2
