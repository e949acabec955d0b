"""What a scene is: one kind of machine or test of grains, as one object."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, ClassVar, Protocol, cast

import numpy as np
from pydantic import Field, model_validator

from fidelity.engine import Grain, Movement, Packing, Setup
from fidelity.grains.filling import Portion
from fidelity.grains.packing import Filling
from fidelity.grains.settings import DemSettings, MaterialSettings
from geometry.mesh import Mesh
from mfopt.arrays import AnyArray, Array
from mfopt.errors import InvalidDesign
from mfopt.limits import Bounds, FrictionAngle, Kilograms, Millimetres
from mfopt.records.level import Level
from mfopt.records.objective import Criteria
from mfopt.records.problem import Problem
from mfopt.records.view import DesignView
from mfopt.settings import Settings, checked


class PortionSettings(Settings):
    """What the settings of all scenes of mfopt share: a portion, its walls, and a design."""

    # What an experiment changes easily, as shares of what the settings say.
    varied: ClassVar[Mapping[str, tuple[float, ...]]] = {"portion_kg": (0.5,)}

    portion_kg: Kilograms
    grain_length_mm: Millimetres
    grain_width_mm: Millimetres
    grain: MaterialSettings
    wall: MaterialSettings
    wall_friction_angle_deg: FrictionAngle | None = None  # None: the smaller of the two materials'
    free: dict[str, Bounds] = Field(min_length=1)  # bounds of a search, by name of a design value

    @model_validator(mode="after")
    def _long(self) -> "PortionSettings":
        if self.grain_length_mm < self.grain_width_mm:
            raise ValueError(
                f"grain_length_mm = {self.grain_length_mm:g} must be at least "
                f"grain_width_mm = {self.grain_width_mm:g}; exchange them"
            )
        return self

    def all_values(self) -> dict[str, float]:
        """Every value that can be free as the settings give it, in the unit of the problem."""
        raise NotImplementedError

    @property
    def outlet_mm(self) -> float | None:
        """Smallest width that the grains pass; None if they pass none."""
        return None

    @property
    def wall_friction_angle(self) -> float | None:
        """Of grains on walls [rad]; None: the smaller one of the two materials' angles."""
        angle = self.wall_friction_angle_deg
        return None if angle is None else math.radians(angle)


@dataclass(frozen=True, slots=True)
class Cycle:
    """How much of a run is work, to predict what a run costs."""

    duration_s: float  # simulated time that grains move
    share: float  # of the spheres that move in it, on average


class Scene(Protocol):
    """One kind of machine or test, with its settings. Must be picklable.

    A dataclass whose fields `settings` and `wanted` are made by their classes if left out.
    A design `x` (d,) is in the units of the problem. `dem` says how finely a level resolves the
    grains.
    """

    name: ClassVar[str]  # in study files

    @property
    def settings(self) -> Settings:
        """What the study says of the scene."""

    @property
    def wanted(self) -> Settings:
        """What the study says of the objectives."""

    def problem(self) -> Problem:
        """Design variables, baseline and hard constraint.

        Raises:
            ConfigError: if the baseline cannot be built, or lies outside the bounds.
        """

    def starts(self, problem: Problem) -> Mapping[str, Array]:
        """Designs by name that an engineer would try first, the baseline first."""

    def criteria(self) -> Criteria:
        """Objectives and quantities of a run."""

    def portion(self, x: Array, dem: DemSettings) -> Portion:
        """The grains of a run, their materials and numerics."""

    def cycle(self, x: Array) -> Cycle:
        """What of a run is work."""

    def filling(self, x: Array, dem: DemSettings, seed: int) -> Filling | None:
        """How the vessel is filled before the run; None if the run begins with loose grains.

        Raises:
            InvalidDesign: if the design cannot be built.
            SimulationError: if the grains do not fit.
        """

    def setup(
        self, x: Array, dem: DemSettings, packing: Packing | None, seed: int, moments: int
    ) -> Setup:
        """The run from a settled packing, with snapshots of all grains at so many moments.

        Raises:
            InvalidDesign: if the design cannot be built.
            SimulationError: if the grains do not fit.
        """

    def results(
        self, x: Array, dem: DemSettings, setup: Setup, movement: Movement, seed: int
    ) -> tuple[dict[str, AnyArray], str | None]:
        """Raw results of a finished movement, SI units; and why they cannot be right, or None."""

    def reduced(self, name: str, grains: int) -> Level | None:
        """The analytic level of that name; None if the scene has none."""

    def view(self, x: Array, dem: DemSettings | None) -> DesignView:
        """What a report shows of a design besides its numbers."""

    def meshes(self, x: Array) -> Mapping[str, Mesh]:
        """The parts of the machine, for viewing and for the workshop."""

    def write_step(self, x: Array, directory: Path) -> str:
        """Write a STEP file for the workshop, and return its name.

        Raises:
            ConfigError: if the scene has none, or the extra `cad` is missing.
        """


def read_scene(
    kind: type[Scene], own: Mapping[str, Any], wanted: Mapping[str, Any], where: str
) -> Scene:
    """The scene that a study describes.

    Args:
        kind: of the scene.
        own: the table [problem.NAME].
        wanted: what [problem] says of the objectives.
        where: its file, for messages.

    Raises:
        ConfigError: if a key is wrong.
    """
    tables: dict[str, Any] = {its.name: its.default_factory for its in fields(cast(Any, kind))}
    made: Scene = cast(Any, kind)(
        checked(tables["settings"], own, where=f"{where}: problem.{kind.name}"),
        checked(tables["wanted"], wanted, where=f"{where}: problem"),
    )
    return made


def raw_of(values: Mapping[str, Any], setup: Setup, movement: Movement) -> dict[str, AnyArray]:
    """Raw results of a run: these values, what every run says of itself, and its snapshots."""
    said = {
        **values,
        "grains": len(movement.exit_times),
        "duration": setup.duration,
        "end_time": movement.end_time,
        "timestep": movement.timestep,
        "max_overlap": movement.max_overlap,
    }
    raw = {name: np.asarray(value) for name, value in said.items()}
    return raw | {name: np.asarray(a, np.float32) for name, a in movement.snapshots.items()}


@dataclass(frozen=True, slots=True)
class Possible:
    """A hard constraint: the machine can be built. A class, so that other processes can have it."""

    settings: Settings
    build: Callable[[Any, Array], object]  # raises ConfigError where it cannot

    def __call__(self, x: Array) -> str | None:
        try:
            self.build(self.settings, x)
        except InvalidDesign as error:
            return str(error)
        return None


def drawn(x: Array, meshes: Mapping[str, Mesh], grain: Grain | None, **more: Any) -> DesignView:
    """A view of a design: its parts, the grain of the target level if it has one, and more."""
    return DesignView(
        x,
        parts={name: (mesh.vertices, mesh.triangles) for name, mesh in meshes.items()},
        grain_offsets=np.empty((0, 3)) if grain is None else grain.offsets,
        grain_radii=np.empty(0) if grain is None else grain.radii,
        **more,
    )
