"""What a grain engine is given and gives back. An engine only moves grains.

A scene builds a `Setup`; an engine moves the grains and returns a `Movement`; the scene turns that
into an outcome. The same holds for filling a vessel.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, Protocol

import numpy as np

from fidelity.samples import Samples, check_samples
from fidelity.sound import require_numbers
from mfopt.arrays import Array, IntArray
from mfopt.errors import ConfigError
from mfopt.records.outcome import Status

ContactLaw = Literal["linear", "hertz"]

# A run on springs is broken when two spheres overlap by more than this [smallest radius]; at 2
# their centres are in one place. Soft grains between the cup's rim and the hole's edge reach 1
# in sound runs.
MAX_OVERLAP = 1.5
# Settled: for this long [s] the grains move with less, per grain, than this part of the energy
# that lifts a grain by its smallest radius.
SETTLED_S = 0.1
SETTLED_ENERGY = 1e-3


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

    def __post_init__(self) -> None:
        k = len(self.radii)
        if k == 0:
            raise ConfigError("a grain of 0 spheres has no shape; give at least 1")
        require_numbers("centres of a grain's spheres [m]", self.offsets, (k, 3))
        require_numbers("radii of a grain's spheres [m]", self.radii, (k,), above=0.0)
        require_numbers("mass of a grain [kg]", np.asarray(self.mass), (), above=0.0)
        require_numbers("moments of inertia of a grain [kg m2]", self.inertia, (3,), above=0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Packing:
    """Positions, orientations and sizes of the grains of one portion."""

    positions: Array  # (n, 3) mass centres [m]
    orientations: Array  # (n, 4) unit quaternions w, x, y, z: grain frame to space
    scales: Array | None = None  # (n,) size relative to `Setup.grain`; None: all are 1

    def __post_init__(self) -> None:
        n = len(self.positions)
        if n == 0:
            raise ConfigError("a packing of 0 grains has nothing to move; give at least 1 grain")
        require_numbers("positions of grains [m]", self.positions, (n, 3))
        require_numbers("orientations of grains", self.orientations, (n, 4))
        lengths = np.linalg.norm(self.orientations, axis=1)
        require_numbers("lengths of the grains' quaternions", lengths, (n,), above=0.0)
        require_numbers("scales of grains", sizes(self), (n,), above=0.0)


def sizes(packing: Packing) -> Array:
    """Scales (n,) of the grains, also where the packing names none."""
    return np.ones(len(packing.positions)) if packing.scales is None else packing.scales


def scaled(grain: Grain, scale: float) -> Grain:
    """The grain `scale` times as large."""
    return Grain(
        grain.offsets * scale,
        grain.radii * scale,
        grain.mass * scale**3,
        grain.inertia * scale**5,
    )


@dataclass(frozen=True, slots=True, eq=False)
class WallMotion:
    """Prescribed motion of a wall, sampled; linear in between, and the last values hold afterwards.

    A point p of the wall is at pivot + R(axis, angle) (p - pivot) + displacement.
    """

    times: Array  # (m,) [s], increasing from 0
    displacements: Array  # (m, 3) [m], 0 at time 0
    angles: Array | None = None  # (m,) [rad], 0 at time 0; None: the wall does not turn
    axis: tuple[float, float, float] = (0.0, 1.0, 0.0)  # unit vector
    pivot: tuple[float, float, float] = (0.0, 0.0, 0.0)  # [m]

    def __post_init__(self) -> None:
        m = len(self.times)
        if m == 0:
            raise ConfigError("a wall's motion has 0 samples; give at least 1, at time 0")
        require_numbers("times of a wall's motion [s]", self.times, (m,))
        require_numbers(
            "steps between times of a wall's motion [s]", np.diff(self.times), (m - 1,), above=0.0
        )
        require_numbers("displacements of a wall [m]", self.displacements, (m, 3))
        if self.angles is not None:
            require_numbers("angles of a wall [rad]", self.angles, (m,))
        require_numbers("axis of a wall's motion", np.asarray(self.axis), (3,))
        require_numbers("pivot of a wall's motion [m]", np.asarray(self.pivot), (3,))


@dataclass(frozen=True, slots=True, eq=False)
class Wall:
    """A rigid triangle mesh."""

    name: str
    vertices: Array  # (v, 3) [m], at time 0
    triangles: IntArray  # (t, 3)
    material: Material
    motion: WallMotion | None = None  # None: it stands still
    # [rad] of grains on this wall; None: the smaller one of the two materials' angles
    friction_angle: float | None = None
    until: float = math.inf  # [s] from then on the wall is gone; all other contacts stay

    def __post_init__(self) -> None:
        if self.friction_angle is not None and not 0 <= self.friction_angle < math.pi / 2:
            raise ConfigError(
                f"wall {self.name!r}: friction_angle = {self.friction_angle:g} rad must be at "
                "least 0 and below pi/2; None takes the smaller one of the materials"
            )
        if math.isnan(self.until):
            raise ConfigError(f"wall {self.name!r}: until = nan must be a time [s]")
        v, t = len(self.vertices), len(self.triangles)
        require_numbers(f"corners of the wall {self.name!r} [m]", self.vertices, (v, 3))
        require_numbers(f"triangles of the wall {self.name!r}", self.triangles, (t, 3), above=-1)
        if t == 0 or np.max(self.triangles) >= v:
            raise ConfigError(
                f"wall {self.name!r}: its {t} triangles must be at least 1, "
                f"and name corners from 0 to {v - 1}"
            )


@dataclass(frozen=True, slots=True)
class BodyForce:
    """A uniform acceleration of the grains whose mass centre is in a box: an air jet, a magnet."""

    lower: tuple[float, float, float]  # [m]
    upper: tuple[float, float, float]  # [m]
    acceleration: tuple[float, float, float]  # [m/s2]


@dataclass(frozen=True, slots=True)
class Physics:
    """Contact and integration settings; what is 0, None or empty is absent.

    An engine that lacks one that is asked for refuses the setup with a `ConfigError`.
    """

    contact_law: ContactLaw = "linear"  # springs of Cundall and Strack, or Hertz and Mindlin
    restitution: float | None = None  # [-] viscous contact damping that returns this
    damping: float = 0.2  # YADE's numerical (Cundall) damping
    damp_gravity: bool = False  # True: the damping also slows free fall, as in the paper
    gravity: float = 9.81  # [m/s2]
    gravity_direction: tuple[float, float, float] = (0.0, 0.0, -1.0)  # unit vector
    # Of r_min sqrt(density / E), and numba scales its own step alike; None: usual for the engine.
    timestep_factor: float | None = 0.6
    rolling_friction: float = 0.0  # [-] largest rolling moment over normal force and radius
    rolling_stiffness: float = 1.0  # [-] of the rolling spring, over kt R*^2 of the contact
    adhesion_energy: float = 0.0  # [J/m2] work of adhesion; pull-off 2 pi R times it
    # Air, for a grain of scale 1; with the scale s the coefficients fall as 1/s2 and 1/s.
    linear_drag: float = 0.0  # [1/s] deceleration per speed
    quadratic_drag: float = 0.0  # [1/m] deceleration per squared speed
    body_forces: tuple[BodyForce, ...] = ()

    def __post_init__(self) -> None:
        length = math.hypot(*self.gravity_direction)
        if not abs(length - 1.0) < 1e-9:
            raise ConfigError(
                f"gravity_direction = {self.gravity_direction} has the length {length:g}, and must "
                "be a unit vector; divide it by its length"
            )
        if not 0.0 < self.rolling_stiffness < math.inf:
            raise ConfigError(
                f"rolling_stiffness = {self.rolling_stiffness:g} must be above 0 and finite; "
                "set rolling_friction = 0 to leave rolling free"
            )


@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """Everything that an engine needs to move the grains."""

    grain: Grain
    packing: Packing
    grain_material: Material
    walls: tuple[Wall, ...]
    physics: Physics
    duration: float  # [s] the run ends here at the latest
    exit_z: float  # [m] a grain whose mass centre falls below leaves; its time is kept
    velocities: Array | None = None  # (n, 3) [m/s] at the start; None: at rest
    angular_velocities: Array | None = None  # (n, 3) [rad/s] in space; None: none turns
    settle: bool = False  # end when the grains are at rest
    # End early after this time [s] once no grain is below `idle_above_z`, i.e. none can still pass.
    idle_after: float = float("inf")
    idle_above_z: float = 0.0  # [m]
    snapshot_times: Array = field(default_factory=lambda: np.empty(0))  # (s,) [s]
    # Walls that move against each other may catch grains and press them through a wall; the scene
    # tells what became of them. False: a grain that goes through a wall breaks the run.
    may_pinch: bool = False
    samples: Samples | None = None  # what to reduce during the run, and when

    def __post_init__(self) -> None:
        n = len(self.packing.positions)
        for name in ("velocities", "angular_velocities"):
            values = getattr(self, name)
            if values is not None:
                require_numbers(f"{name} of grains", values, (n, 3))
        if len(np.unique(self.packing.positions, axis=0)) < n:
            raise ConfigError("two grains are at the same position; move them apart")
        require_numbers("duration of a run [s]", np.asarray(self.duration), (), above=0.0)
        if self.samples is not None:
            check_samples(self.samples, duration=self.duration, exit_z=self.exit_z)


def smallest_radius(setup: Setup) -> float:
    """Radius [m] of the smallest sphere of all grains."""
    return float(np.min(sizes(setup.packing)) * np.min(setup.grain.radii))


@dataclass(frozen=True, slots=True, eq=False)
class Movement:
    """What became of the grains. On failure, `status` and `why` say what happened."""

    status: Status
    why: str | None
    exit_times: Array  # (n,) [s], nan for grains that did not leave
    positions: Array  # (n, 3) [m] at the end; where it left, for a grain that left
    orientations: Array  # (n, 4)
    velocities: Array  # (n, 3) [m/s]
    angular_velocities: Array  # (n, 3) [rad/s] in space
    end_time: float  # [s]
    steps: int
    sphere_steps: float  # spheres moved, summed over the steps
    timestep: float  # [s]
    max_overlap: float  # largest overlap seen, in units of the smallest radius
    max_kinetic_energy: float  # [J]
    cpu_s: float
    snapshots: Mapping[str, Array] = field(default_factory=dict)
    # "snapshot_times" (s,), "snapshot_positions" (s, n, 3), "snapshot_orientations" (s, n, 4),
    # "snapshot_speeds" (s, n) [m/s], nan for grains that have left; and from engines that keep
    # them "snapshot_wall_forces" (s, w, 3) [N], what the grains exert on each wall
    energy: Mapping[str, float] = field(default_factory=dict)
    # [J] where the engine keeps a balance, see there
    series: Mapping[str, Array] = field(default_factory=dict)
    # reduced during the run, where `Setup.samples` asks for it: see `fidelity.samples.series`


def checked(movement: Movement) -> Movement:
    """The movement, as crashed if it finished with places or velocities that are no numbers."""
    lost = np.zeros(len(movement.positions), dtype=bool)
    for values in (
        movement.positions,
        movement.orientations,
        movement.velocities,
        movement.angular_velocities,
    ):
        lost |= ~np.isfinite(values).all(axis=1)
    if movement.status != "finished" or not lost.any():
        return movement
    why = f"the place or velocity of {lost.sum()} of {len(lost)} grains is not a number"
    return replace(movement, status="crashed", why=why)


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

    def timestep(
        self, grain: Grain, grain_material: Material, wall_material: Material, physics: Physics
    ) -> float:
        """Time step [s] that `move` takes, but for what it shortens on account of the walls."""

    def move(self, setup: Setup, *, time_limit_s: float) -> Movement:
        """Move the grains. A run that crashes, explodes or hangs is returned as such.

        Raises:
            ConfigError: if the setup asks for physics that the engine lacks.
        """
