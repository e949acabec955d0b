"""The heap of a lifted cylinder as a scene."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from pydantic import Field

from fidelity.engine import Movement, Packing, Setup
from fidelity.grains.filling import Rained
from fidelity.grains.settings import MILLI, DemSettings
from fidelity.scene import Cycle, raw_of
from fidelity.scenes.beads import Vessel, VesselScene, checked_design, problem_of
from fidelity.scenes.heap.run import (
    HeapSettings,
    check_heap,
    cylinder_mesh,
    filling_setup,
    heap_result,
    heap_setup,
    plate_mesh,
)
from geometry.mesh import Mesh
from mfopt.arrays import AnyArray, Array, frozen
from mfopt.limits import Bounds, Degrees, Millimetres, Milliseconds
from mfopt.records.objective import Criteria, Objective, Quantity, Raw
from mfopt.records.problem import Problem
from mfopt.records.view import DesignView
from mfopt.settings import Settings

WORK_SHARE = 1.0  # all spheres stay
HEIGHT = 2.0  # of the drawn cylinder in its radius


class Cylinder(Vessel):
    """A cylinder on a plate."""

    units: ClassVar[Mapping[str, str]] = {"radius": "mm", "lift_speed": "mm/s"}

    radius_mm: Millimetres = 40
    lift_speed_mm_s: float = Field(default=100, ge=1.0, le=10_000.0)
    lift_height_mm: Millimetres = 150
    plate_mm: Millimetres = 400  # side of the plate
    rest_ms: Milliseconds = 300  # from the end of the lift to that of the run
    free: dict[str, Bounds] = Field(
        default_factory=lambda: {"lift_speed": (20.0, 400.0)}, min_length=1
    )

    def all_values(self) -> dict[str, float]:
        """Value of every measure that can be free [mm, mm/s]."""
        return {"radius": self.radius_mm, "lift_speed": self.lift_speed_mm_s}


class Wanted(Settings):
    """What a study can say of the objective."""

    angle_deg: Degrees = 25.0  # of repose, that is wanted


def built(settings: Cylinder, x: Array) -> HeapSettings:
    """The cylinder of the design `x` (d,) [mm, mm/s].

    Raises:
        InvalidDesign: if it cannot be built.
    """
    values = settings.values_at(x)
    heap = HeapSettings(
        radius=MILLI * values["radius"],
        plate=MILLI * settings.plate_mm,
        lift_speed=MILLI * values["lift_speed"],
        lift_height=MILLI * settings.lift_height_mm,
        rest=MILLI * settings.rest_ms,
    )
    checked_design(lambda: check_heap(heap))
    return heap


def _angle(raw: Raw) -> float:
    """Angle of repose [rad]."""
    return float(raw["angle"])


def _radius(raw: Raw) -> float:
    """Radius of the heap [m]."""
    return float(raw["radius"])


def _angle_error(wanted: float, raw: Raw) -> dict[str, float]:
    """Distance of the angle of repose from the wanted one [rad]."""
    return {"angle error": abs(_angle(raw) - wanted)}


@dataclass(frozen=True, slots=True)
class Heap(VesselScene):
    """Grains that form a heap when their cylinder is lifted. Implements `fidelity.scene.Scene`."""

    name: ClassVar[str] = "heap"

    settings: Cylinder = field(default_factory=Cylinder)
    wanted: Wanted = field(default_factory=Wanted)

    def problem(self) -> Problem:
        """The free measures."""
        return problem_of(self.settings, built, objective_unit="rad")

    def criteria(self) -> Criteria:
        """Angle and radius of the heap."""
        wanted = math.radians(self.wanted.angle_deg)
        error = Objective("angle_error", lambda raw: _angle_error(wanted, raw))
        return Criteria(
            {"angle_error": error},
            (
                Quantity(
                    "angle of repose",
                    "rad",
                    _angle,
                    (180.0 / math.pi, "°"),
                    lower_is_better=False,
                    wanted=wanted,
                ),
                Quantity("radius of the heap", "m", _radius, (1e3, "mm"), lower_is_better=False),
            ),
            "angle of repose",
            (),
            self.wanted.model_dump(mode="json"),
        )

    def cycle(self, x: Array) -> Cycle:
        """Lift and rest."""
        its = built(self.settings, x)
        return Cycle(its.lift_height / its.lift_speed + its.rest, WORK_SHARE)

    def filling(self, x: Array, dem: DemSettings, seed: int) -> Rained:
        """The grains rain into the cylinder."""
        return Rained(filling_setup(built(self.settings, x), self.portion(x, dem), seed))

    def setup(
        self, x: Array, dem: DemSettings, packing: Packing | None, seed: int, moments: int
    ) -> Setup:
        """The full cylinder when its lift begins."""
        assert packing is not None
        setup = heap_setup(built(self.settings, x), self.portion(x, dem), packing)
        times = np.linspace(0.0, 1.0, moments + 1)[1:] * setup.duration * (1.0 - 1e-3)
        return replace(setup, snapshot_times=frozen(times))

    def results(
        self, x: Array, dem: DemSettings, setup: Setup, movement: Movement, seed: int
    ) -> tuple[dict[str, AnyArray], str | None]:
        """The heap at the end."""
        told = heap_result(setup.grain, movement, setup.packing.scales)
        values = {
            "angle": told.angle, "radius": told.radius, "radii": told.radii,
            "heights": told.heights, "mean_height": told.mean_height, "fallen": told.fallen,
        }  # fmt: skip
        return raw_of(values, setup, movement), None

    def meshes(self, x: Array) -> Mapping[str, Mesh]:
        """Cylinder and plate."""
        its = built(self.settings, x)
        return {"cylinder": cylinder_mesh(its, HEIGHT * its.radius), "plate": plate_mesh(its)}

    def view(self, x: Array, dem: DemSettings | None) -> DesignView:
        """Cylinder and plate, the lift, and the grains of the target level."""
        its = built(self.settings, x)
        up_s = its.lift_height / its.lift_speed
        return replace(
            super(Heap, self).view(x, dem),
            moving=frozenset({"cylinder"}),
            mover="cylinder",
            upwards=True,
            motion_times=frozen([0.0, up_s, up_s, up_s + its.rest]),
            motion_positions=frozen([0.0, its.lift_height, its.lift_height, its.lift_height]),
            motion_velocities=frozen([its.lift_speed, its.lift_speed, 0.0, 0.0]),
        )
