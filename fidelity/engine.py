"""What a grain engine is given and gives back. An engine only moves grains.

A scene (dosing) builds a `Setup`; an engine (yade, bullet) moves the grains and returns
a `Movement`; the scene turns that into an outcome. The same holds for filling the cup.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from mfopt.arrays import Array, IntArray
from mfopt.outcome import Status


@dataclass(frozen=True, slots=True)
class Material:
    """Elastic-frictional material (Cundall-Strack)."""

    young_modulus: float  # [Pa]
    poisson_ratio: float  # tangential to normal stiffness, as in YADE's FrictMat
    friction_angle: float  # [rad]
    density: float  # [kg/m3]


@dataclass(frozen=True, slots=True, eq=False)
class Grain:
    """A rigid clump of spheres in its principal frame: long axis x, origin at its mass centre."""

    offsets: Array  # (k, 3) sphere centres [m]
    radii: Array  # (k,) [m]
    mass: float  # [kg], overlaps counted once
    inertia: Array  # (3,) principal moments about x, y, z [kg m2]


@dataclass(frozen=True, slots=True, eq=False)
class Packing:
    """Positions and orientations of the grains of one portion."""

    positions: Array  # (n, 3) mass centres [m]
    orientations: Array  # (n, 4) unit quaternions w, x, y, z: grain frame to space


@dataclass(frozen=True, slots=True, eq=False)
class Wall:
    """A rigid triangle mesh."""

    name: str
    vertices: Array  # (v, 3) [m], at time 0
    triangles: IntArray  # (t, 3)
    moves: bool = False  # whether it follows `Setup.motion`


@dataclass(frozen=True, slots=True, eq=False)
class WallMotion:
    """Displacement of the moving walls along x, sampled; linear in between."""

    times: Array  # (m,) [s], from 0
    displacements: Array  # (m,) [m], 0 at time 0; the last value holds afterwards


@dataclass(frozen=True, slots=True)
class Physics:
    """Contact and integration settings shared by all DEM engines."""

    damping: float = 0.2  # YADE's numerical (Cundall) damping
    damp_gravity: bool = False  # True: the damping also slows free fall, as in the paper
    gravity: float = 9.81  # [m/s2], along -z
    timestep_factor: float = 0.6  # of r_min sqrt(density / E)


@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """Everything that an engine needs to move the grains."""

    grain: Grain
    packing: Packing
    grain_material: Material
    wall_material: Material
    walls: tuple[Wall, ...]
    physics: Physics
    duration: float  # [s] the run ends here at the latest
    exit_z: float  # [m] a grain whose mass centre falls below leaves; its time is kept
    motion: WallMotion | None = None
    start_velocity: float = 0.0  # [m/s] of all grains along x; one that comes with the cup
    settle: bool = False  # end when the grains are at rest
    # End early after this time [s] once no grain is below `idle_above_z`, i.e. none can still pass.
    idle_after: float = float("inf")
    idle_above_z: float = 0.0  # [m]
    snapshot_times: Array = field(default_factory=lambda: np.empty(0))  # (s,) [s]


@dataclass(frozen=True, slots=True, eq=False)
class Movement:
    """What became of the grains. On failure, `status` and `why` say what happened."""

    status: Status
    why: str | None
    exit_times: Array  # (n,) [s], nan for grains that did not leave
    positions: Array  # (n, 3) [m] at the end; where it left, for a grain that left
    orientations: Array  # (n, 4)
    velocities: Array  # (n, 3) [m/s]
    end_time: float  # [s]
    steps: int
    sphere_steps: float  # spheres moved, summed over the steps
    timestep: float  # [s]
    max_overlap: float  # largest overlap seen, in units of the smallest radius
    max_kinetic_energy: float  # [J]
    cpu_s: float
    snapshots: Mapping[str, Array] = field(default_factory=dict)
    # "snapshot_times" (s,), "snapshot_positions" (s, n, 3), "snapshot_orientations" (s, n, 4),
    # "snapshot_speeds" (s, n) [m/s]; nan for grains that have left


class Engine(Protocol):
    """A discrete-element engine. Must be picklable."""

    @property
    def name(self) -> str:
        """Engine and what of its settings changes results, e.g. `yade` or `yade-longdouble`."""

    @property
    def cost_factor(self) -> float:
        """Cost of one sphere-step relative to YADE in double precision."""

    def version(self) -> str:
        """Version of the program behind it.

        Raises:
            ConfigError: if it is not installed; the message says how to install it.
        """

    def move(self, setup: Setup, *, time_limit_s: float) -> Movement:
        """Move the grains. A run that crashes, explodes or hangs is returned as such."""
