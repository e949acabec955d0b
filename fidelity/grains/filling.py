"""Filling a vessel: grains are put in loosely, rain down, and come to rest with full friction.

The same on every engine, so that a packing differs between engines only by how they move it.
"""

import math
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from fidelity.engine import (
    Engine,
    Grain,
    Material,
    Movement,
    Packing,
    Physics,
    Setup,
    Wall,
    WallMotion,
    scaled,
    sizes,
)
from fidelity.grains.packing import Settled
from fidelity.grains.portion import count_flaw, loose_portion
from fidelity.grains.sizes import EQUAL, Sizes, drawn
from geometry.mesh import Mesh
from geometry.sections import Section
from mfopt.arrays import Array, IntArray, frozen
from mfopt.errors import SimulationError

FILLING_DAMPING = 0.4  # [-] numerical damping, on the fall too: brings the grains to rest soon
COMING_TO_REST = 0.4  # [s] after the fall; grains that still move then creep at a few mm/s


@dataclass(frozen=True, slots=True, eq=False)
class Portion:
    """Grains of one kind, and the materials and numerics that they are moved with."""

    grain: Grain
    grains: int
    grain_material: Material
    wall_material: Material
    physics: Physics
    sizes: Sizes = EQUAL
    # [rad] of grains on walls; None: the smaller one of the two materials' angles
    wall_friction_angle: float | None = None

    @property
    def mass(self) -> float:
        """Mass of all grains [kg]."""
        return self.grains * self.grain.mass

    def wall(self, name: str, mesh: Mesh, motion: WallMotion | None = None) -> Wall:
        """A wall of that shape, as these grains feel it."""
        return Wall(
            name,
            mesh.vertices,
            mesh.triangles,
            self.wall_material,
            motion,
            self.wall_friction_angle,
        )

    @property
    def grain_length(self) -> float:
        """Length of a grain of scale 1 along its long axis [m]."""
        ends = np.abs(self.grain.offsets[:, 0]) + self.grain.radii
        return 2.0 * float(ends.max())

    @property
    def grain_diameter(self) -> float:
        """Diameter of the sphere that weighs as much as the mean grain [m]."""
        return math.cbrt(6.0 * self.grain.mass / (math.pi * self.grain_material.density))


def loose_in(
    portion: Portion, section: Section, bottom_z: float, seed: int, *, chordal_error: float = 0.0
) -> Packing:
    """Put the portion loosely into a vessel of that section, from `bottom_z` [m] up.

    `chordal_error` [m] is how far the vessel's mesh may lie within its exact section.

    Raises:
        SimulationError: if the grain is too long for the vessel.
    """
    scales = drawn(portion.sizes, portion.grains, seed)
    largest = portion.grain if scales is None else scaled(portion.grain, float(scales.max()))
    loose = loose_portion(largest, section, portion.grains, seed, chordal_error=chordal_error)
    positions = frozen(loose.positions + np.array([0.0, 0.0, bottom_z]))
    return Packing(positions, loose.orientations, scales)


def top_of(portion: Portion, packing: Packing) -> float:
    """Height [m] above which none of the grains reaches, however it turns."""
    return float(packing.positions[:, 2].max()) + portion.grain_length * float(sizes(packing).max())


def filling_physics(portion: Portion) -> Physics:
    """The portion's physics, damped so that falling grains soon rest."""
    return replace(portion.physics, damping=FILLING_DAMPING, damp_gravity=True)


def filling_time(portion: Portion, height: float) -> float:
    """Time [s] within which grains that fall `height` [m] at most come to rest."""
    acceleration = (1.0 - FILLING_DAMPING) * portion.physics.gravity
    return math.sqrt(2.0 * height / acceleration) + COMING_TO_REST


def settling_setup(portion: Portion, loose: Packing, walls: tuple[Wall, ...]) -> Setup:
    """Let loose grains rain down in a closed vessel until they rest."""
    floor = min(float(wall.vertices[:, 2].min()) for wall in walls)
    return Setup(
        grain=portion.grain,
        packing=loose,
        grain_material=portion.grain_material,
        walls=walls,
        physics=filling_physics(portion),
        duration=filling_time(portion, top_of(portion, loose) - floor),
        exit_z=floor - portion.grain_length,
        settle=True,
    )


def settled(movement: Movement, scales: Array | None = None) -> Packing:
    """The packing that a filling ended with, of grains of these scales (n,).

    Raises:
        SimulationError: if the run failed, or a grain got out of the vessel.
    """
    if movement.status != "finished":
        raise SimulationError(f"filling the vessel failed: {movement.why}")
    out = int(np.isfinite(movement.exit_times).sum())
    if out:
        raise SimulationError(
            f"{out} grains left the closed vessel while it was filled; use a shorter time step or "
            "stiffer grains"
        )
    return Packing(frozen(movement.positions), frozen(movement.orientations), scales)


def filled(engine: Engine, setup: Setup, *, time_limit_s: float) -> tuple[Packing, Movement]:
    """Run a `settling_setup`: the packing at rest, and the movement for what it cost.

    Raises:
        SimulationError: if the grains cannot be settled; the message says what happened.
    """
    movement = engine.move(setup, time_limit_s=time_limit_s)
    return settled(movement, setup.packing.scales), movement


@dataclass(frozen=True, slots=True, eq=False)
class Rained:
    """Grains that rain into a closed vessel and rest there with their full friction.

    Implements `fidelity.grains.packing.Filling`.
    """

    setup: Setup  # a `settling_setup`

    def described(self) -> dict[str, Any]:
        """All that the packing depends on, besides the engine."""
        return asdict(self.setup)

    def settle(self, engine: Engine, time_limit_s: float) -> Settled:
        """Fill the vessel.

        Raises:
            SimulationError: if the grains cannot be settled; the message says what happened.
        """
        packing, movement = filled(engine, self.setup, time_limit_s=time_limit_s)
        return Settled(packing, movement.cpu_s, movement.sphere_steps * engine.cost_factor)

    def flaw(self, packing: Packing) -> str | None:
        """Why a packing from the cache cannot be used, or None."""
        wanted = len(self.setup.packing.positions)
        return count_flaw(packing, wanted)


def rectangle(length: float, width: float, z: float) -> list[list[float]]:
    """Corners of a horizontal rectangle around x = y = 0, counter-clockwise from above [m]."""
    x, y = length / 2, width / 2
    return [[-x, -y, z], [x, -y, z], [x, y, z], [-x, y, z]]


def plane(length: float, width: float, z: float) -> Mesh:
    """A horizontal rectangle around x = y = 0 [m]."""
    return Mesh(np.array(rectangle(length, width, z)), np.array([[0, 1, 2], [0, 2, 3]]))


def strip(lower: IntArray, upper: IntArray) -> list[list[int]]:
    """Triangles between two closed rings of as many vertices; normals to the outside."""
    triangles = []
    for a, b, c, d in zip(lower, np.roll(lower, -1), np.roll(upper, -1), upper, strict=True):
        triangles += [[a, b, c], [a, c, d]]
    return triangles
