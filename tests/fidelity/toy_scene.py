"""A ball that rolls down a ramp: a whole scene, as a user would add one."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np

from fidelity.engine import Movement, Packing, Setup, Wall
from fidelity.grains.filling import Portion
from fidelity.grains.grain import line_grain
from fidelity.grains.settings import STEEL, DemSettings
from fidelity.scene import Cycle
from fidelity.scenes.beads import BEADS
from geometry.mesh import Mesh
from mfopt.arrays import AnyArray, Array, frozen
from mfopt.errors import ConfigError
from mfopt.records.objective import Criteria, Objective, Quantity, Raw
from mfopt.records.problem import Problem, Variable
from mfopt.records.view import DesignView
from mfopt.settings import Settings

LENGTH = 0.2  # [m] of the ramp, along its slope


class RampSettings(Settings):
    """A ramp, whose slope is free."""

    slope_deg: float = 20.0


class Wanted(Settings):
    """When the ball should arrive."""

    arrival_ms: float = 250.0


def arrival(raw: Raw) -> float:
    """Time [s] at which the ball leaves the ramp."""
    return float(raw["arrival"])


@dataclass(frozen=True, slots=True)
class Ramp:
    """A ball on a ramp."""

    name: ClassVar[str] = "ramp"

    settings: RampSettings = field(default_factory=RampSettings)
    wanted: Wanted = field(default_factory=Wanted)

    def problem(self) -> Problem:
        return Problem((Variable("slope", 5, 60, "deg"),), frozen([self.settings.slope_deg]))

    def starts(self, problem: Problem) -> Mapping[str, Array]:
        return {"baseline": problem.baseline}

    def criteria(self) -> Criteria:
        wanted = 1e-3 * self.wanted.arrival_ms
        late = Objective("lateness", lambda raw: {"late": abs(arrival(raw) - wanted)})
        shown = Quantity("arrival", "s", arrival, (1e3, "ms"))
        return Criteria({"lateness": late}, (shown,), "arrival", {"arrival_ms": 1e3 * wanted})

    def portion(self, x: Array, dem: DemSettings) -> Portion:
        ball = line_grain(5e-3, 5e-3, 1, BEADS.density_kg_m3)
        materials = BEADS.material(dem.young_modulus_pa), STEEL.material()
        return Portion(ball, dem.grains, *materials, dem.physics())

    def cycle(self, x: Array) -> Cycle:
        return Cycle(1.0, 1.0)

    def filling(self, x: Array, dem: DemSettings, seed: int) -> None:
        """The ball is put there."""

    def setup(
        self, x: Array, dem: DemSettings, packing: Packing | None, seed: int, moments: int
    ) -> Setup:
        portion, mesh = self.portion(x, dem), self.meshes(x)["ramp"]
        radius = float(portion.grain.radii[0])
        start = np.array([[0.0, 0.0, mesh.vertices[:, 2].max() + 1.02 * radius]])
        return Setup(
            portion.grain, Packing(start, np.array([[1.0, 0.0, 0.0, 0.0]])),
            portion.grain_material,
            (Wall("ramp", mesh.vertices, mesh.triangles, portion.wall_material),),
            portion.physics, duration=1.0, exit_z=-2.0 * radius,
            snapshot_times=frozen(np.linspace(0.0, 0.1, moments)),
        )  # fmt: skip

    def results(
        self, x: Array, dem: DemSettings, setup: Setup, movement: Movement, seed: int
    ) -> tuple[dict[str, AnyArray], str | None]:
        raw = {"arrival": np.asarray(movement.exit_times[0])}
        raw |= {name: np.asarray(a) for name, a in movement.snapshots.items()}
        return raw, None

    def reduced(self, name: str, grains: int) -> None:
        """There is none."""

    def view(self, x: Array, dem: DemSettings | None) -> DesignView:
        parts = {name: (m.vertices, m.triangles) for name, m in self.meshes(x).items()}
        return DesignView(label="", x=x, parts=parts)

    def meshes(self, x: Array) -> Mapping[str, Mesh]:
        slope = np.radians(x[0])
        along, up, half = LENGTH * np.cos(slope), LENGTH * np.sin(slope), 0.02
        corners = [[-0.01, -half, up], [along, -half, 0.0], [along, half, 0.0], [-0.01, half, up]]
        return {"ramp": Mesh(np.array(corners), np.array([[0, 1, 2], [0, 2, 3]]))}

    def write_step(self, x: Array, directory: Path) -> str:
        raise ConfigError("a ramp has no STEP file")
