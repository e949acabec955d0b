"""The project's own engine: discrete elements compiled by Numba, in this process, on one core.

Runs repeat bit for bit on one machine. `fidelity/dem` is the engine; this is its face.
"""

from dataclasses import dataclass

import numba
import numpy as np

from fidelity.dem.run import run
from fidelity.dem.timestep import MARGIN, stable_timestep
from fidelity.engine import Grain, Material, Movement, Packing, Physics, Setup
from mfopt.errors import ConfigError

KERNEL = "1"  # counted up when results change


@dataclass(frozen=True, slots=True)
class NumbaEngine:
    """The engine, with what can be set."""

    margin: float = MARGIN  # share of the stable step of a single contact
    fixed_timestep: float | None = None  # [s] instead

    def __post_init__(self) -> None:
        if not 0.0 < self.margin <= 1.0:
            raise ConfigError(f"margin = {self.margin:g} must lie in 0 to 1; {MARGIN:g} is usual")
        if self.fixed_timestep is not None and not self.fixed_timestep > 0.0:
            raise ConfigError(
                f"fixed_timestep = {self.fixed_timestep:g} s must be positive; leave it out for "
                "the stable step"
            )

    @property
    def name(self) -> str:
        """`numba`."""
        return "numba"

    @property
    def cost_factor(self) -> float:
        """Cost of one sphere-step relative to YADE in double precision."""
        return 0.1

    def version(self) -> str:
        """Version of the kernel and of the compiler."""
        return f"{KERNEL} (numba {numba.__version__})"

    def timestep(
        self, grain: Grain, grain_material: Material, wall_material: Material, physics: Physics
    ) -> float:
        """Time step [s]."""
        if self.fixed_timestep is not None:
            return self.fixed_timestep
        return self.margin * stable_timestep(grain, grain_material, wall_material, physics)

    def move(self, setup: Setup, *, time_limit_s: float) -> Movement:
        """Move the grains. A run that crashes, explodes or hangs is returned as such."""
        smallest = scaled(setup.grain, smallest_scale(setup.packing))
        walls = [wall.material for wall in setup.walls] or [setup.grain_material]
        dt = min(
            self.timestep(smallest, setup.grain_material, wall, setup.physics) for wall in walls
        )
        return run(setup, dt, time_limit_s)


def smallest_scale(packing: Packing) -> float:
    """Scale of the smallest grain."""
    return 1.0 if packing.scales is None else float(np.min(packing.scales))


def scaled(grain: Grain, scale: float) -> Grain:
    """The grain `scale` times as large."""
    return Grain(
        grain.offsets * scale,
        grain.radii * scale,
        grain.mass * scale**3,
        grain.inertia * scale**5,
    )
