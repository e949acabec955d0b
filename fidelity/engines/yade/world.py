"""The scene of a run inside YADE: walls as facets, grains as clumps, and what a step does.

Part of `fidelity.engines.yade.script`, which says what it may import.
Contacts are linear with Coulomb friction (Cundall & Strack 1979, doi:10.1680/geot.1979.29.1.47),
or Hertz's with Mindlin's friction and viscous damping that returns a given restitution
(Thornton et al. 2013, doi:10.1016/j.powtec.2012.08.012).
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from yade import O, utils
from yade.minieigenHP import Quaternion, Vector3
from yade.wrapper import (
    Bo1_Facet_Aabb,
    Bo1_Sphere_Aabb,
    DragEngine,
    ForceResetter,
    FrictMat,
    Ig2_Facet_Sphere_ScGeom,
    Ig2_Sphere_Sphere_ScGeom,
    InsertionSortCollider,
    InteractionLoop,
    Ip2_FrictMat_FrictMat_FrictPhys,
    Ip2_FrictMat_FrictMat_MindlinPhys,
    Law2_ScGeom_FrictPhys_CundallStrack,
    Law2_ScGeom_MindlinPhys_Mindlin,
    LinearDragEngine,
    MatchMaker,
    NewtonIntegrator,
    Sphere,
    VTKRecorder,
)

from fidelity.engine import Grain, Material, Physics, Setup, WallMotion, sizes
from mfopt.arrays import Array

GRAINS, WALLS = 1, 2  # collision groups: walls are in both, and not checked against each other
WHITE = (1.0, 1.0, 1.0)  # without a colour, YADE draws one and reseeds Python's generator

# Reach of the neighbour search in units of the smallest radius; 0.05 to 0.3 are alike.
VERLET = 0.2


@dataclass
class Wall:
    """A wall and its triangles."""

    facets: list[Any]  # YADE's bodies
    middles: Array  # (t, 3) [m] of the facets at time 0, where YADE has their positions
    motion: WallMotion | None
    material: int  # YADE's number
    friction_angle: float | None  # [rad] of grains on it; None: the smaller one of the materials
    until: float  # [s] then it goes


@dataclass
class Grains:
    """All grains, as YADE knows them."""

    states: list[Any]  # YADE's State
    ids: list[int]  # YADE's body number of the clump
    frames: list[Any]  # rotation from the grain's frame to YADE's clump frame
    masses: Array  # (n,) [kg]
    z: Array  # (n,) [m] at the last check
    start_spin: Array  # (n,) [J] energy of the turning at the start


def add_material(material: Material) -> int:
    """Add a material; its number."""
    return int(
        O.materials.append(
            FrictMat(
                young=material.young_modulus,
                poisson=material.poisson_ratio,
                frictionAngle=material.friction_angle,
                density=material.density,
            )
        )
    )


def add_walls(setup: Setup) -> list[Wall]:
    """Add all triangles; walls of equal material and friction share it."""
    materials: dict[tuple[Material, float | None], int] = {}
    walls = []
    for wall in setup.walls:
        own = wall.material, wall.friction_angle
        if own not in materials:
            materials[own] = add_material(wall.material)
        facets = []
        for triangle in wall.triangles.tolist():
            corners = [Vector3(*wall.vertices[k].tolist()) for k in triangle]
            facet = utils.facet(corners, material=materials[own], color=WHITE, mask=GRAINS | WALLS)
            O.bodies.append(facet)
            facets.append(facet)
        middles = np.array([[float(v) for v in facet.state.pos] for facet in facets])
        angle, number = wall.friction_angle, materials[own]
        walls.append(Wall(facets, middles, wall.motion, number, angle, wall.until))
    return walls


def add_grains(setup: Setup) -> Grains:
    """Add the grains as clumps with the mass, inertia and first velocity that each grain has."""
    material = add_material(setup.grain_material)
    positions, scales = setup.packing.positions, sizes(setup.packing)
    felt = felt_masses(setup.grain)
    ids, states, frames = [], [], []
    for i, scale in enumerate(scales.tolist()):
        w, x, y, z = setup.packing.orientations[i].tolist()
        turn = Quaternion(w, x, y, z)
        turn.normalize()
        number = add_clump(setup.grain, positions[i].tolist(), turn, scale, material)
        for member, mass in zip(O.bodies[number].shape.members, felt, strict=True):
            O.bodies[member].state.mass = scale**3 * mass
        state = O.bodies[number].state
        ids.append(number)
        states.append(state)
        frames.append(state.ori.conjugate() * turn)
    masses = setup.grain.mass * scales**3
    grains = Grains(states, ids, frames, masses, positions[:, 2].copy(), np.zeros(len(ids)))
    start(setup, grains)
    return grains


def add_clump(grain: Grain, position: list[float], turn: Any, scale: float, material: int) -> int:
    """Add one grain of that scale; its body number."""
    members = [
        utils.sphere(
            Vector3(*position) + turn * Vector3(*(scale * offset).tolist()),
            scale * radius,
            material=material,
            color=WHITE,
            mask=GRAINS,
        )
        for offset, radius in zip(grain.offsets, grain.radii.tolist(), strict=True)
    ]
    number, _ = O.bodies.appendClumped(members, discretization=0)
    clump = O.bodies[number]
    clump.aspherical = True
    frame = clump.state.ori.conjugate() * turn
    clump.state.mass = scale**3 * grain.mass
    clump.state.inertia = clump_inertia(frame, scale**5 * grain.inertia)
    return int(number)


def felt_masses(grain: Grain) -> list[float]:
    """Mass (k,) [kg] that resists a push on each sphere of the grain, across the sphere's arm.

        1 / m_felt = 1 / m + max over unit n of (a x n) I^-1 (a x n),   a the sphere's offset

    YADE damps a contact by the masses of its two spheres, and uses these for nothing else: with
    it, one contact of a grain returns the restitution, except for a push along the arm, which
    feels the whole mass and returns more.
    """
    felt = []
    for x, y, z in grain.offsets:
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        turning = np.linalg.eigvalsh(cross.T @ np.diag(1.0 / grain.inertia) @ cross)
        felt.append(1.0 / (1.0 / grain.mass + float(turning.max())))
    return felt


def start(setup: Setup, grains: Grains) -> None:
    """Give the grains their first velocities and angular velocities."""
    if setup.velocities is not None:
        for state, velocity in zip(grains.states, setup.velocities.tolist(), strict=True):
            state.vel = Vector3(*velocity)
    if setup.angular_velocities is None:
        return
    for i, spin in enumerate(setup.angular_velocities.tolist()):
        state = grains.states[i]
        state.angVel = Vector3(*spin)
        # YADE steps the angular momentum [kg m2/s], in space, and makes the velocity from it.
        turn = state.ori.toRotationMatrix()
        own = turn.transpose() * state.angVel
        state.angMom = turn * Vector3(*(state.inertia[k] * own[k] for k in range(3)))
        grains.start_spin[i] = 0.5 * float(state.angVel.dot(state.angMom))


def clump_inertia(frame: Any, inertia: Any) -> Any:
    """Principal moments [kg m2] along the axes that YADE chose for the clump.

    YADE takes the axes from its own, coarser inertia; a grain that has other principal axes
    than that cannot be represented.
    """
    turn = np.array([[float(v) for v in row] for row in frame.toRotationMatrix()])
    tensor = turn @ np.diag(inertia) @ turn.T
    off_axis = np.abs(tensor - np.diag(np.diag(tensor))).max()
    if off_axis > 1e-3 * inertia.max():
        raise ValueError("the grain's principal axes are not those of its spheres")
    return Vector3(*np.diag(tensor).tolist())


def engines(setup: Setup, walls: list[Wall], engine: dict[str, Any]) -> list[Any]:
    """What YADE does in a step."""
    physics = setup.physics
    turns = any(wall.motion is not None and wall.motion.angles is not None for wall in walls)
    made = [
        ForceResetter(),
        InsertionSortCollider(
            [Bo1_Sphere_Aabb(), Bo1_Facet_Aabb()],
            # A turn about its own middle moves a facet out of its bounding box unnoticed: with a
            # reach of 0 the boxes are made anew in every step.
            verletDist=0.0 if turns else -VERLET,
            avoidSelfInteractionMask=WALLS,
        ),
        InteractionLoop(
            [Ig2_Sphere_Sphere_ScGeom(), Ig2_Facet_Sphere_ScGeom()],
            *contact_law(physics, frictions(walls)),
        ),
        *drags(setup),
        NewtonIntegrator(
            damping=physics.damping,
            gravity=Vector3(*gravity_vector(physics).tolist()),
            # Grains at rest tremble for ever where only contact forces are damped.
            dampGravity=physics.damp_gravity or setup.settle,
        ),
    ]
    trace = engine.get("trace")
    if trace is not None:
        period = max(1, round(engine["trace_period"] / O.dt))
        recorders = ["spheres", "facets", "velocity"]
        made.append(VTKRecorder(fileName=trace, recorders=recorders, iterPeriod=period))
    return made


def drags(setup: Setup) -> list[Any]:
    """Air on grains of one sphere: F = 6 pi nu r v, and F = rho / 2 C_d pi r^2 v^2 with C_d = 1."""
    physics, grain = setup.physics, setup.grain
    mass, radius = grain.mass, float(grain.radii[0])
    spheres = [body.id for body in O.bodies if isinstance(body.shape, Sphere)]
    made = []
    if physics.linear_drag > 0.0:
        nu = physics.linear_drag * mass / (6.0 * math.pi * radius)
        made.append(LinearDragEngine(nu=nu, ids=spheres))
    if physics.quadratic_drag > 0.0:
        rho = 2.0 * physics.quadratic_drag * mass / (math.pi * radius**2)
        made.append(DragEngine(Rho=rho, Cd=1.0, ids=spheres))
    return made


def gravity_vector(physics: Physics) -> Array:
    """Acceleration (3,) of free fall [m/s2]."""
    return physics.gravity * np.array(physics.gravity_direction)


def frictions(walls: list[Wall]) -> dict[str, Any]:
    """Friction of the walls that have one of their own, as an argument of YADE's functors."""
    grains = len(O.materials) - 1  # whose material was added last
    own = {
        (wall.material, grains, wall.friction_angle)
        for wall in walls
        if wall.friction_angle is not None
    }
    return {"frictAngle": MatchMaker(matches=sorted(own), algo="min")} if own else {}


def contact_law(physics: Physics, friction: dict[str, Any]) -> tuple[list[Any], list[Any]]:
    """What makes a contact's stiffness, and what its force."""
    if physics.contact_law == "hertz":
        # YADE's pull of 4 pi R* gamma is that of the work of adhesion 2 gamma.
        energy = physics.adhesion_energy
        made = Ip2_FrictMat_FrictMat_MindlinPhys(
            en=physics.restitution, gamma=energy / 2, **friction
        )
        return [made], [Law2_ScGeom_MindlinPhys_Mindlin(includeAdhesion=energy > 0.0)]
    made = Ip2_FrictMat_FrictMat_FrictPhys(**friction)
    return [made], [Law2_ScGeom_FrictPhys_CundallStrack()]
