"""The discharge of a hopper as a scene."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np

from fidelity.effects.switch import is_on
from fidelity.engine import Movement, Packing, Setup
from fidelity.grains.filling import Rained
from fidelity.grains.settings import DemSettings
from fidelity.samples import level_means
from fidelity.scene import Cycle, raw_of
from fidelity.scenes.beads import VesselScene, problem_of
from fidelity.scenes.discharge import objectives
from fidelity.scenes.discharge.run import (
    discharge_result,
    discharge_samples,
    discharge_setup,
    filling_setup,
    vessel_meshes,
)
from fidelity.scenes.discharge.settings import Hopper, built
from geometry.mesh import Mesh
from mfopt.arrays import AnyArray, Array, frozen
from mfopt.records.objective import Criteria
from mfopt.records.problem import Problem
from mfopt.records.view import DesignView

WORK_SHARE = 0.6  # of the spheres move, on average: they leave one after the other
LOOSEST = 0.5  # solid share of grains that were poured, for the height of a drawn hopper


@dataclass(frozen=True, slots=True)
class Discharge(VesselScene):
    """A filled hopper whose gate opens. Implements `fidelity.scene.Scene`."""

    name: ClassVar[str] = "discharge"

    settings: Hopper = field(default_factory=Hopper)
    wanted: objectives.Wanted = field(default_factory=objectives.Wanted)

    def problem(self) -> Problem:
        """The free measures of the hopper."""
        return problem_of(self.settings, built)

    def criteria(self) -> Criteria:
        """Mass flow rate, discharge time, mass left."""
        return objectives.criteria(self.wanted)

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
            "left": told.left,
            "lost": told.lost,
            "sample_times": movement.series["sample_times"],
            "discharged_fraction": movement.series["passed"][:, 0],
            "level": mean,
            "level_left": left_half,
            "level_right": right_half,
            "levels": levels,
        }
        lost = f"{told.lost} grains got out beside the outlet; use a shorter time step"
        return raw_of(values, setup, movement), lost if told.lost else None

    def view(self, x: Array, dem: DemSettings | None) -> DesignView:
        """The hopper, and the grains of the target level."""
        steep = np.degrees(built(self.settings, x).floor_angle)
        note = f"The floor stands at {steep:.0f}° to the horizontal."
        counted_at = f"{self.settings.fall_mm:g} mm below the outlet"
        return replace(VesselScene.view(self, x, dem), notes=(note,), counted_at=counted_at)

    def meshes(self, x: Array) -> Mapping[str, Mesh]:
        """The hopper, as high as the portion fills it."""
        its, s = built(self.settings, x), self.settings
        volume = s.portion_kg / s.grain.density_kg_m3 / LOOSEST
        height = volume / (its.length * its.depth)
        return vessel_meshes(its, max(its.shoulder, its.bar_top) + height)
