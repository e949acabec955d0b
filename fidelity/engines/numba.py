"""The project's own engine: discrete elements compiled by Numba, in this process, on one core.

Runs repeat bit for bit on one machine. `fidelity/dem` is the engine; this is its face. It loads
the engine at first use: that takes as long as all the rest of mfopt.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from typing import Any

import numpy as np

from fidelity.engine import (
    Grain,
    Material,
    Movement,
    Packing,
    Physics,
    Setup,
    Wall,
    WallMotion,
    checked,
    scaled,
    sizes,
)
from mfopt.errors import ConfigError

KERNEL = "2"  # counted up when results change
# Share of the stable step of a single contact at the usual `Physics.timestep_factor`: in a pile
# many act at once. docs/engine shows what other values do.
MARGIN = 0.2
USUAL_STEP = 0.6
# A Hertz contact is soft at small overlaps: up to 3 a discharge stays the same
# (`benchmarks.engine.rig`). A dashpot sees the velocity of half a step ago, which matters the more
# the stronger it is: at 2.0 damped grains of restitution 0.3 discharge 3 % too slowly, from 0.5 on
# they do not (`benchmarks.engine.step`). Below, the step falls with the root of the damping ratio.
HERTZ_STEP = 2.0
LEAST_BOUNCE = 0.5
FEW_LOOKS_S = 0.02  # [s] simulated time in which a run calls every function of the kernel


@dataclass(frozen=True, slots=True)
class NumbaEngine:
    """The engine, with what can be set."""

    margin: float = MARGIN  # share of the stable step of a single contact at the usual step
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
        return f"{KERNEL} (numba {metadata.version('numba')})"

    def timestep(
        self, grain: Grain, grain_material: Material, wall_material: Material, physics: Physics
    ) -> float:
        """Time step [s]."""
        from fidelity.dem.timestep import stable_timestep

        if self.fixed_timestep is not None:
            return self.fixed_timestep
        factor = physics.timestep_factor
        if factor is None:
            factor = _hertz_step(physics) if physics.contact_law == "hertz" else USUAL_STEP
        share = self.margin * (factor / USUAL_STEP)
        return share * stable_timestep(grain, grain_material, wall_material, physics)

    def move(self, setup: Setup, *, time_limit_s: float) -> Movement:
        """Move the grains. A run that crashes, explodes or hangs is returned as such."""
        from fidelity.dem.run import run

        smallest = scaled(setup.grain, float(np.min(sizes(setup.packing))))
        walls = [wall.material for wall in setup.walls] or [setup.grain_material]
        dt = min(
            self.timestep(smallest, setup.grain_material, wall, setup.physics) for wall in walls
        )
        return checked(run(setup, dt, time_limit_s))


def _hertz_step(physics: Physics) -> float:
    """Usual `Physics.timestep_factor` of Hertz contacts."""
    from fidelity.dem.restitution import damping_ratio

    if physics.restitution is None or physics.restitution >= LEAST_BOUNCE:
        return HERTZ_STEP
    stronger = damping_ratio("hertz", physics.restitution) / damping_ratio("hertz", LEAST_BOUNCE)
    return HERTZ_STEP / math.sqrt(stronger)


def prepare(compiling: Callable[[], None] = lambda: None) -> None:
    """Compile the kernel where that has not been done, by a run of two grains.

    What is compiled is kept. Without this, workers that start together all compile it.

    Args:
        compiling: called once if there is something to compile, before the half minute it takes.
    """
    from numba.core.event import install_listener

    with install_listener("numba:compile", first_only(compiling)):
        NumbaEngine().move(_two_grains(), time_limit_s=float("inf"))


def first_only(tell: Callable[[], None]) -> Any:
    """A listener to Numba's events that passes on the first."""
    from numba.core.event import Event, Listener

    class First(Listener):
        told = False

        def on_start(self, event: Event) -> None:
            if not self.told:
                self.told = True
                tell()

        def on_end(self, event: Event) -> None:
            pass

    return First()


def _two_grains() -> Setup:
    """Two grains over a plate that is moved."""
    material = Material(young_modulus=1e6, poisson_ratio=0.3, friction_angle=0.5, density=1000.0)
    radius, mass = 1e-3, 4e-6
    corners = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
    motion = WallMotion(np.array([0.0, 1.0]), np.zeros((2, 3)))
    return Setup(
        grain=Grain(np.zeros((1, 3)), np.array([radius]), mass, np.full(3, 0.4 * mass * radius**2)),
        packing=Packing(
            radius * np.array([[0.0, 0.0, 1.0], [1.9, 0.0, 1.0]]),
            np.tile([1.0, 0.0, 0.0, 0.0], (2, 1)),
        ),
        grain_material=material,
        walls=(Wall("plate", corners, np.array([[0, 1, 2]]), material, motion),),
        physics=Physics(),
        duration=FEW_LOOKS_S,
        exit_z=-1.0,
    )
