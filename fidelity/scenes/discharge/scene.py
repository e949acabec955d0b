"""The discharge of a hopper as a scene."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from fidelity.effects.switch import is_on
from fidelity.engine import Movement, Packing, Setup
from fidelity.grains.filling import Portion, Rained
from fidelity.grains.settings import DemSettings
from fidelity.samples import level_means
from fidelity.scene import Cycle, drawn
from fidelity.scenes.beads import problem_of
from fidelity.scenes.discharge import objectives
from fidelity.scenes.discharge.run import (
    discharge_result,
    discharge_samples,
    discharge_setup,
    filling_setup,
    hopper_mesh,
)
from fidelity.scenes.discharge.settings import Hopper, built
from geometry.mesh import Mesh
from mfopt.arrays import AnyArray, Array, frozen
from mfopt.errors import ConfigError
from mfopt.records.objective import Criteria
from mfopt.records.problem import Problem
from mfopt.records.view import DesignView
from mfopt.settings import checked

WORK_SHARE = 0.6  # of the spheres move, on average: they leave one after the other
LOOSEST = 0.5  # solid share of grains that were poured, for the height of a drawn hopper


@dataclass(frozen=True, slots=True)
class Discharge:
    """A filled hopper whose gate opens. Implements `fidelity.scene.Scene`."""

    name: ClassVar[str] = "discharge"

    settings: Hopper = field(default_factory=Hopper)
    wanted: objectives.Wanted = field(default_factory=objectives.Wanted)

    @classmethod
    def read(cls, own: Mapping[str, Any], wanted: Mapping[str, Any], where: str) -> "Discharge":
        """The scene that a study describes."""
        return cls(
            checked(Hopper, own, where=f"{where}: problem.{cls.name}"),
            checked(objectives.Wanted, wanted, where=f"{where}: problem"),
        )

    def problem(self) -> Problem:
        """The free measures of the hopper."""
        return problem_of(self.settings, built)

    def starts(self, problem: Problem) -> Mapping[str, Array]:
        """The hopper as it is given."""
        return {"baseline": problem.baseline}

    def criteria(self) -> Criteria:
        """Mass flow rate, discharge time, mass left."""
        return objectives.criteria(self.wanted)

    def portion(self, x: Array, dem: DemSettings) -> Portion:
        """The grains in the hopper."""
        return self.settings.portion(dem)

    def cycle(self, x: Array) -> Cycle:
        """The run, from the opening of the gate."""
        return Cycle(built(self.settings, x).duration, WORK_SHARE)

    def filling(self, x: Array, dem: DemSettings, seed: int) -> Rained:
        """The grains rain onto the closed gate."""
        return Rained(filling_setup(built(self.settings, x), self.portion(x, dem), seed))

    def setup(
        self, x: Array, dem: DemSettings, packing: Packing | None, seed: int, moments: int
    ) -> Setup:
        """The full hopper when the gate opens."""
        assert packing is not None
        its, portion = built(self.settings, x), self.portion(x, dem)
        times = np.linspace(0.0, its.duration, self.settings.samples + 1)
        gate_until = 0.0 if is_on(dem.effects, "slow_gate") else None
        return replace(
            discharge_setup(its, portion, packing, gate_until=gate_until),
            samples=discharge_samples(its, portion, times),
            snapshot_times=frozen(np.linspace(0.0, 1.0, moments + 1)[:-1] * its.duration),
        )

    def results(
        self, x: Array, dem: DemSettings, setup: Setup, movement: Movement, seed: int
    ) -> tuple[dict[str, AnyArray], str | None]:
        """When grains passed, and the quantities over time."""
        its, portion = built(self.settings, x), self.portion(x, dem)
        told = discharge_result(its, portion, movement, setup.packing.scales)
        assert setup.samples is not None
        assert setup.samples.columns is not None
        levels = movement.series["levels"]
        mean, left_half, right_half = level_means(setup.samples.columns, levels)
        values = {
            "passage_times": told.times,
            "mass_flow_rate": told.mass_flow_rate,
            "grains": len(movement.exit_times),
            "left": told.left,
            "lost": told.lost,
            "duration": setup.duration,
            "end_time": movement.end_time,
            "timestep": movement.timestep,
            "max_overlap": movement.max_overlap,
            "sample_times": movement.series["sample_times"],
            "discharged_fraction": movement.series["passed"][:, 0],
            "level": mean,
            "level_left": left_half,
            "level_right": right_half,
            "levels": levels,
        }
        raw = {name: np.asarray(value) for name, value in values.items()}
        raw |= {name: np.asarray(a, np.float32) for name, a in movement.snapshots.items()}
        lost = f"{told.lost} grains got out beside the outlet; use a shorter time step"
        return raw, lost if told.lost else None

    def reduced(self, name: str, grains: int) -> None:
        """There is no analytic model of a discharge yet."""

    def view(self, x: Array, dem: DemSettings | None) -> DesignView:
        """The hopper, and the grains of the target level."""
        its = built(self.settings, x)
        steep = np.degrees(its.floor_angle)
        grain = None if dem is None else self.portion(x, dem).grain
        return drawn(
            x,
            self.meshes(x),
            grain,
            notes=(f"The floor stands at {steep:.0f}° to the horizontal.",),
        )

    def meshes(self, x: Array) -> Mapping[str, Mesh]:
        """The hopper, as high as the portion fills it."""
        its, s = built(self.settings, x), self.settings
        volume = s.portion_kg / s.grain.density_kg_m3 / LOOSEST
        return {"hopper": hopper_mesh(its, its.shoulder + volume / (its.length * its.depth))}

    def write_step(self, x: Array, directory: Path) -> str:
        """There is no STEP file of a plane hopper.

        Raises:
            ConfigError: always; its plates are in the STL file.
        """
        raise ConfigError("the scene discharge writes no STEP file; its plates are in hopper.stl")
