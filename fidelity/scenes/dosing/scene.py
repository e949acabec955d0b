"""The dosing machine as a scene."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

from fidelity.engine import Movement, Packing, Setup
from fidelity.grains.filling import Portion
from fidelity.grains.settings import MILLI, DemSettings
from fidelity.scene import Cycle, drawn
from fidelity.scenes.dosing import objectives
from fidelity.scenes.dosing.bound import filling_time_bound, smallest_filling_time_bound
from fidelity.scenes.dosing.design import (
    cup_motion,
    design,
    design_parts,
    dosing_problem,
    starting_designs,
)
from fidelity.scenes.dosing.filling import CupFilling
from fidelity.scenes.dosing.reduced import ReducedDosing
from fidelity.scenes.dosing.run import cup_filling, dosing_grain, dosing_setup, raw_results, tally
from fidelity.scenes.dosing.settings import DosingSettings
from geometry.manufacturability import manufacturability
from geometry.mesh import Mesh
from mfopt.arrays import AnyArray, Array
from mfopt.records.objective import Criteria
from mfopt.records.problem import Problem
from mfopt.records.view import Colour, DesignView

# Spheres times steps moved, per all spheres times the steps of the cycle: a run ends after the
# cycle, and grains that have left cost nothing. 1.0 to 1.25 for designs that empty the cup.
WORK_SHARE = 1.1

# Okabe and Ito's colour-blind-safe palette (2008).
COLOURS: Mapping[str, Colour] = {
    "hopper": (0.337, 0.706, 0.914),
    "cup": (0.902, 0.624, 0.0),
    "tube": (0.75, 0.75, 0.75),
    "plate": (0.85, 0.85, 0.85),
}
TRANSLUCENT: Mapping[str, float] = {"plate": 0.5, "cup": 0.75}  # they would hide the hopper


@dataclass(frozen=True, slots=True)
class Dosing:
    """A cup that moves over a hopper. Implements `fidelity.scene.Scene`."""

    name: ClassVar[str] = "dosing"

    settings: DosingSettings = field(default_factory=DosingSettings)
    wanted: objectives.Wanted = field(default_factory=objectives.Wanted)

    def problem(self) -> Problem:
        """The free parameters of hopper and motion; the baseline design."""
        return dosing_problem(self.settings)

    def starts(self, problem: Problem) -> Mapping[str, Array]:
        """The baseline, and simple motions over its hopper."""
        return starting_designs(problem)

    def criteria(self) -> Criteria:
        """Spread of the passage times, filling time, mass left."""
        return objectives.criteria(objectives.weights_of(self.wanted))

    def portion(self, x: Array, dem: DemSettings) -> Portion:
        """The portion in the cup."""
        its = cup_filling(self.settings, dem, seed=0)
        return Portion(
            its.grain, its.grains, its.grain_material, its.wall_material, its.physics,
            wall_friction_angle=self.settings.wall_friction_angle,
        )  # fmt: skip

    def cycle(self, x: Array) -> Cycle:
        """A cycle of the machine."""
        return Cycle(MILLI * self.settings.cycle_ms, WORK_SHARE)

    def filling(self, x: Array, dem: DemSettings, seed: int) -> CupFilling:
        """The portion settled in the cup; the same for every design that can be built."""
        design(self.settings, x)
        return cup_filling(self.settings, dem, seed)

    def setup(
        self, x: Array, dem: DemSettings, packing: Packing | None, seed: int, moments: int
    ) -> Setup:
        """The filled cup at the start of its motion."""
        assert packing is not None
        machine = design(self.settings, x)
        order = cup_filling(self.settings, dem, seed)
        return dosing_setup(self.settings, machine, order, packing, moments)

    def results(
        self, x: Array, dem: DemSettings, setup: Setup, movement: Movement, seed: int
    ) -> tuple[dict[str, AnyArray], str | None]:
        """Passage times, and how many grains stayed behind."""
        count = tally(design(self.settings, x), setup, movement)
        raw = raw_results(setup, movement, count, seed)
        if not count.lost:
            return raw, None
        return raw, (
            f"{count.lost} of {dem.grains} grains were lost, the first at "
            f"{count.first_lost}; use a shorter time step or stiffer grains"
        )

    def reduced(self, name: str, grains: int) -> ReducedDosing:
        """The analytic model."""
        return ReducedDosing(name, self.settings, grains)

    def view(self, x: Array, dem: DemSettings | None) -> DesignView:
        """Machine, motion, bounds and how it can be made."""
        machine, motion = design(self.settings, x), cup_motion(self.settings, x)
        grain = None if dem is None else dosing_grain(self.settings, dem)
        law = machine.motion
        bound = _finite(filling_time_bound(machine))
        bound_any = _finite(smallest_filling_time_bound(self.settings))
        points = {"P1": (law.x1, law.y1), "P2": (law.x2, law.y2)}
        return drawn(
            x,
            self.meshes(x),
            grain,
            colours=COLOURS,
            translucent=TRANSLUCENT,
            backdrop=frozenset({"plate"}),
            moving=frozenset({"cup"}),
            mover="cup",
            motion_times=motion.times,
            motion_positions=motion.positions,
            motion_velocities=motion.velocities,
            motion_points={
                name: (t * machine.cycle, machine.stroke * (y - 0.5))
                for name, (t, y) in points.items()
            },
            notes=tuple(manufacturability(machine.loft).sentences()),
            bound=bound,
            bound_any=bound_any,
            bound_note=_bound_note(bound, bound_any),
            counted_at="the tube's end",
            clock="the start of the cycle",
        )

    def meshes(self, x: Array) -> Mapping[str, Mesh]:
        """Cup, plate, hopper and tube."""
        return design_parts(self.settings, x)

    def write_step(self, x: Array, directory: Path) -> str:
        """Write the hopper."""
        from geometry.step import write_step  # needs the extra cad

        machine = design(self.settings, x)
        write_step(directory / "hopper.step", machine.loft, machine.tube_end_z)
        return "hopper.step"


def _bound_note(bound_s: float | None, bound_any_s: float | None) -> str:
    """What the physical lower bounds of the filling time say."""
    if bound_s is None:
        return ""
    text = f"With this motion no hopper can fill faster than {1e3 * bound_s:.0f} ms"
    if bound_any_s is not None:
        text += f", and with any motion none faster than {1e3 * bound_any_s:.0f} ms"
    return f"{text}: the physical lower bound."


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
