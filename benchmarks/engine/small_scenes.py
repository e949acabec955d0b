"""Small scenes with a closed form, for the tests and the validation of the compiled engine."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import Delaunay

from fidelity.dem.timestep import stable_timestep
from fidelity.engine import Grain, Material, Movement, Packing, Physics, Setup, Wall, WallMotion
from fidelity.engines.numba import NumbaEngine
from fidelity.grains.grain import line_grain
from mfopt.arrays import Array, IntArray
from mfopt.errors import SimulationError

R = 4e-3  # [m] sphere radius
G = 9.81  # [m/s2]
DENSITY = 1400.0  # [kg/m3]
YOUNG = 1e6  # [Pa]
RATIO = 0.3  # tangential to normal stiffness, or Poisson's ratio
LIMIT_S = 600.0  # wall clock; the first run on a machine compiles the kernel
LEVEL = (1.0, 0.0, 0.0, 0.0)  # orientation of a grain that lies along x


def spheres_in_line(count: int) -> Grain:
    """Spheres of radius `R` in a line, 1.25 radii apart."""
    return line_grain((2 + 1.25 * (count - 1)) * R, 2 * R, count, DENSITY)


def sled(half: float = 2 * R) -> Grain:
    """Four spheres at the corners of a square: it stands on a plane as a block does."""
    x, y = (a.ravel() for a in np.meshgrid([-half, half], [-half, half]))
    mass = 4 * DENSITY * 4 / 3 * math.pi * R**3
    own = 0.4 * mass * R**2
    across = own + mass * half**2
    return Grain(
        np.column_stack([x, y, np.zeros(4)]),
        np.full(4, R),
        mass,
        np.array([across, across, own + 2 * mass * half**2]),
    )


def asymmetric() -> Grain:
    """A grain with three different moments of inertia; its spheres touch nothing in free flight."""
    mass = 1e-3
    return Grain(np.zeros((1, 3)), np.full(1, R), mass, mass * R**2 * np.array([0.4, 1.0, 1.3]))


def material(friction: float = 0.0, young: float = YOUNG) -> Material:
    """A material with that coefficient of friction."""
    return Material(young, RATIO, math.atan(friction), DENSITY)


def still(**changes: object) -> Physics:
    """No gravity and no damping but what is asked for."""
    return Physics(**{"gravity": 0.0, "damping": 0.0, **changes})  # type: ignore[arg-type]


def down(slope: float) -> Array:
    """Unit vector down a slope that falls along x."""
    return np.array([math.cos(slope), 0.0, -math.sin(slope)])


def off(slope: float) -> Array:
    """Unit normal of that slope."""
    return np.array([math.sin(slope), 0.0, math.cos(slope)])


def leaning(slope: float) -> tuple[float, float, float, float]:
    """Orientation of a grain that lies on that slope."""
    return (math.cos(slope / 2), 0.0, math.sin(slope / 2), 0.0)


def plane(
    slope: float = 0.0,
    friction: float = 0.0,
    young: float = YOUNG,
    half: float = 0.5,
    motion: WallMotion | None = None,
) -> Wall:
    """A square of two triangles through the origin."""
    along, across = half * down(slope), np.array([0.0, half, 0.0])
    corners = [-along - across, along - across, along + across, -along + across]
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    return Wall("plane", np.array(corners), faces, material(friction, young), motion)


def mesh(vertices: Array, triangles: IntArray, friction: float = 0.0) -> Wall:
    """Any wall."""
    return Wall("mesh", vertices, triangles, material(friction))


@dataclass(frozen=True)
class Start:
    """Where a grain starts, and how it moves then."""

    position: Sequence[float] | Array
    orientation: Sequence[float] | Array = LEVEL
    velocity: Sequence[float] | Array = (0.0, 0.0, 0.0)
    spin: Sequence[float] | Array = field(default=(0.0, 0.0, 0.0))


def scene(
    grain: Grain,
    starts: Sequence[Start],
    *walls: Wall,
    physics: Physics,
    duration: float,
    friction: float = 0.0,
    young: float = YOUNG,
    snapshots: Sequence[float] | Array = (),
    exit_z: float = -10.0,
) -> Setup:
    """The setup of a few grains."""
    return Setup(
        grain=grain,
        packing=Packing(
            np.array([s.position for s in starts], dtype=float),
            np.array([s.orientation for s in starts], dtype=float),
        ),
        grain_material=material(friction, young),
        walls=walls,
        physics=physics,
        duration=duration,
        exit_z=exit_z,
        velocities=np.array([s.velocity for s in starts], dtype=float),
        angular_velocities=np.array([s.spin for s in starts], dtype=float),
        snapshot_times=np.array(snapshots),
    )


def moved(setup: Setup, share: float = 0.1) -> Movement:
    """Run with a step of that share of the stable one.

    Raises:
        SimulationError: if the run fails.
    """
    return finished(NumbaEngine(margin=share).move(setup, time_limit_s=LIMIT_S))


def finished(movement: Movement) -> Movement:
    """The movement.

    Raises:
        SimulationError: if it failed.
    """
    if movement.status != "finished":
        raise SimulationError(f"{movement.status}: {movement.why}")
    return movement


def stable_step(setup: Setup) -> float:
    """Stable step [s] of a single contact."""
    wall = setup.walls[0].material if setup.walls else setup.grain_material
    return stable_timestep(setup.grain, setup.grain_material, wall, setup.physics)


def wall_stiffness(radius: float = R, young: float = YOUNG, wall_young: float = YOUNG) -> float:
    """Normal stiffness [N/m] of a sphere on a wall: 2 E r each, the wall's radius 2 r."""
    return (
        2
        * (young * radius)
        * (2 * wall_young * radius)
        / (young * radius + 2 * wall_young * radius)
    )


def turned(quaternion: Array, vectors: Array) -> Array:
    """Vectors (..., 3) of the grain's frame in space."""
    w, v = quaternion[0], np.asarray(quaternion[1:])
    twist = 2 * np.cross(v, vectors)
    return np.asarray(vectors + w * twist + np.cross(v, twist))


def forces_at(centres: Array, *walls: Wall, physics: Physics | None = None) -> Array:
    """What the walls exert on a sphere at rest at each of the centres (n, 3) [N].

    Spheres that lie close must be given their own part of the wall, for they feel each other.
    """
    grain = spheres_in_line(1)
    step = 1e-5
    setup = scene(
        grain,
        [Start(c) for c in centres],
        *walls,
        physics=physics or still(),
        duration=step,
    )
    movement = finished(NumbaEngine(fixed_timestep=step).move(setup, time_limit_s=LIMIT_S))
    return np.asarray(movement.velocities * grain.mass / (step / 2))  # the first kick is a half


def ridge(angle: float, length: float, *, flank: float = 0.1) -> tuple[Array, IntArray]:
    """Two planes that meet along y at z = 0 and fall away by `angle` each; below 0 they rise."""
    fall = flank * math.sin(angle)
    x = flank * math.cos(angle)
    corners = [(-x, 0, -fall), (0, 0, 0), (x, 0, -fall)]
    vertices = np.array([(a, y, c) for y in (0.0, length) for a, _, c in corners])
    faces = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])
    return vertices, faces


def trough(facets: int, radius: float, length: float = 0.2) -> tuple[Array, IntArray]:
    """The lower half of a lying cylinder about y, of flat facets whose middles touch `radius`."""
    edges = np.linspace(-math.pi / 2, math.pi / 2, facets + 1)
    out = radius / math.cos(math.pi / facets / 2)
    ring = np.column_stack([out * np.sin(edges), np.zeros(facets + 1), -out * np.cos(edges)])
    half = np.array([0.0, length / 2, 0.0])
    vertices = np.concatenate([ring - half, ring + half])
    k, n = np.arange(facets), facets + 1
    lower = np.column_stack([k, k + 1, k + 1 + n])
    return vertices, np.concatenate([lower, np.column_stack([k, k + 1 + n, k + n])])


def shattered(seed: int, points: int, half: float) -> tuple[Array, IntArray]:
    """A level square at z = 0 in random triangles that share their edges."""
    rng = np.random.default_rng(seed)
    rim = np.linspace(-half, half, 12)
    border = [(s, t) for s in rim for t in rim if half in (abs(s), abs(t))]
    flat = np.concatenate([np.array(border), rng.uniform(-half, half, (points, 2))])
    return np.column_stack([flat, np.zeros(len(flat))]), Delaunay(flat).simplices


def fan(triangles: int, half: float) -> tuple[Array, IntArray]:
    """A level disc at z = 0 whose triangles all meet at its middle."""
    angles = 2 * math.pi * np.arange(triangles) / triangles
    rim = half * np.column_stack([np.cos(angles), np.sin(angles), np.zeros(triangles)])
    k = np.arange(triangles)
    faces = np.column_stack([np.zeros(triangles, int), 1 + k, 1 + (k + 1) % triangles])
    return np.vstack([np.zeros((1, 3)), rim]), faces
