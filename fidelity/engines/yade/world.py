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

from fidelity.engine import WallMotion
from fidelity.engines.exchange import read_motion

GRAINS, WALLS = 1, 2  # collision groups: walls are in both, and not checked against each other
WHITE = (1.0, 1.0, 1.0)  # without a colour, YADE draws one and reseeds Python's generator

# Reach of the neighbour search in units of the smallest radius; 0.05 to 0.3 are alike.
VERLET = 0.2


@dataclass
class Wall:
    """A wall and its triangles."""

    facets: list[Any]  # YADE's bodies
    middles: Any  # (t, 3) [m] of the facets at time 0, where YADE has their positions
    vertices: Any  # (v, 3) [m] at time 0
    motion: WallMotion | None
    material: int  # YADE's number
    friction_angle: float | None  # [rad] of grains on it; None: the smaller one of the materials
    until: float  # [s] then it goes


@dataclass
class Grains:
    """The grains that are still there, and what became of all of them."""

    numbers: list[int]  # of the grains still there
    states: list[Any]  # of all grains: YADE's State
    ids: list[int]  # of all grains: YADE's body number of the clump
    frames: list[Any]  # of all grains: rotation from the grain's frame to YADE's clump frame
    masses: Any  # (n,) [kg]
    r_min: float  # [m] smallest radius
    z: Any  # (n,) [m] at the last check
    start_speed: float  # [m/s] of the fastest
    start_spin: Any  # (n,) [J] energy of the turning at the start
    exit_times: Any  # (n,) [s]
    # Filled when a grain leaves, and at the end:
    positions: Any  # (n, 3)
    orientations: Any  # (n, 4)
    velocities: Any  # (n, 3)
    angular_velocities: Any  # (n, 3)


def add_material(material: dict[str, float]) -> int:
    """Add a material; its number."""
    return int(
        O.materials.append(
            FrictMat(
                young=material["young_modulus"],
                poisson=material["poisson_ratio"],
                frictionAngle=material["friction_angle"],
                density=material["density"],
            )
        )
    )


def add_walls(given: dict[str, Any]) -> list[Wall]:
    """Add all triangles; walls of equal material and friction share it."""
    materials: list[tuple[dict[str, Any], int]] = []
    walls = []
    for i, wall in enumerate(given["walls"]):
        own = {**wall["material"], "on_wall": wall["friction_angle"]}
        number = next((n for known, n in materials if known == own), None)
        if number is None:
            number = add_material(wall["material"])
            materials.append((own, number))
        vertices = given[f"wall_vertices_{i}"]
        facets = []
        for triangle in given[f"wall_triangles_{i}"].tolist():
            corners = [Vector3(*vertices[k].tolist()) for k in triangle]
            facet = utils.facet(corners, material=number, color=WHITE, mask=GRAINS | WALLS)
            O.bodies.append(facet)
            facets.append(facet)
        middles = np.array([[float(v) for v in facet.state.pos] for facet in facets])
        motion, angle = read_motion(i, wall, given), wall["friction_angle"]
        until = math.inf if wall["until"] is None else wall["until"]
        walls.append(Wall(facets, middles, vertices, motion, number, angle, until))
    return walls


def add_grains(given: dict[str, Any]) -> Grains:
    """Add the grains as clumps with the mass, inertia and first velocity that each grain has."""
    material = add_material(given["grain_material"])
    positions, orientations = given["positions"], given["orientations"]
    n = len(positions)
    scales = given.get("scales", np.ones(n))
    felt = felt_masses(given)
    ids, states, frames = [], [], []
    for i in range(n):
        w, x, y, z = orientations[i].tolist()
        turn = Quaternion(w, x, y, z)
        turn.normalize()
        number = add_clump(given, positions[i].tolist(), turn, float(scales[i]), material)
        for member, mass in zip(O.bodies[number].shape.members, felt, strict=True):
            O.bodies[member].state.mass = float(scales[i]) ** 3 * mass
        state = O.bodies[number].state
        ids.append(number)
        states.append(state)
        frames.append(state.ori.conjugate() * turn)
    nowhere = np.full((n, 4), np.nan)
    grains = Grains(
        list(range(n)),
        states,
        ids,
        frames,
        masses=given["grain_mass"] * scales**3,
        r_min=float(scales.min() * given["grain_radii"].min()),
        z=positions[:, 2].copy(),
        start_speed=0.0,
        start_spin=np.zeros(n),
        exit_times=nowhere[:, 0].copy(),
        positions=nowhere[:, :3].copy(),
        orientations=nowhere.copy(),
        velocities=nowhere[:, :3].copy(),
        angular_velocities=nowhere[:, :3].copy(),
    )
    start(given, grains)
    return grains


def add_clump(
    given: dict[str, Any], position: list[float], turn: Any, scale: float, material: int
) -> int:
    """Add one grain of that scale; its body number."""
    members = [
        utils.sphere(
            Vector3(*position) + turn * Vector3(*(scale * offset).tolist()),
            scale * radius,
            material=material,
            color=WHITE,
            mask=GRAINS,
        )
        for offset, radius in zip(
            given["grain_offsets"], given["grain_radii"].tolist(), strict=True
        )
    ]
    number, _ = O.bodies.appendClumped(members, discretization=0)
    clump = O.bodies[number]
    clump.aspherical = True
    frame = clump.state.ori.conjugate() * turn
    clump.state.mass = scale**3 * given["grain_mass"]
    clump.state.inertia = clump_inertia(frame, scale**5 * given["grain_inertia"])
    return int(number)


def felt_masses(given: dict[str, Any]) -> list[float]:
    """Mass (k,) [kg] that resists a push on each sphere of the grain, across the sphere's arm.

        1 / m_felt = 1 / m + max over unit n of (a x n) I^-1 (a x n),   a the sphere's offset

    YADE damps a contact by the masses of its two spheres, and uses these for nothing else: with
    it, one contact of a grain returns the restitution, except for a push along the arm, which
    feels the whole mass and returns more.
    """
    felt = []
    for x, y, z in given["grain_offsets"]:
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        turning = np.linalg.eigvalsh(cross.T @ np.diag(1.0 / given["grain_inertia"]) @ cross)
        felt.append(1.0 / (1.0 / given["grain_mass"] + float(turning.max())))
    return felt


def start(given: dict[str, Any], grains: Grains) -> None:
    """Give the grains their first velocities and angular velocities."""
    if "velocities" in given:
        grains.start_speed = float(np.linalg.norm(given["velocities"], axis=1).max())
        for state, velocity in zip(grains.states, given["velocities"].tolist(), strict=True):
            state.vel = Vector3(*velocity)
    if "angular_velocities" not in given:
        return
    for i, spin in enumerate(given["angular_velocities"].tolist()):
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


def engines(given: dict[str, Any], walls: list[Wall]) -> list[Any]:
    """What YADE does in a step."""
    physics = given["physics"]
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
        *drags(given),
        NewtonIntegrator(
            damping=physics["damping"],
            gravity=Vector3(*gravity_vector(physics).tolist()),
            # Grains at rest tremble for ever where only contact forces are damped.
            dampGravity=physics["damp_gravity"] or given["settle"],
        ),
    ]
    trace = given["engine"].get("trace")
    if trace is not None:
        period = max(1, round(given["engine"]["trace_period"] / O.dt))
        recorders = ["spheres", "facets", "velocity"]
        made.append(VTKRecorder(fileName=trace, recorders=recorders, iterPeriod=period))
    return made


def drags(given: dict[str, Any]) -> list[Any]:
    """Air on grains of one sphere: F = 6 pi nu r v, and F = rho / 2 C_d pi r^2 v^2 with C_d = 1."""
    physics, mass, radius = given["physics"], given["grain_mass"], float(given["grain_radii"][0])
    spheres = [body.id for body in O.bodies if isinstance(body.shape, Sphere)]
    made = []
    if physics["linear_drag"] > 0.0:
        nu = physics["linear_drag"] * mass / (6.0 * math.pi * radius)
        made.append(LinearDragEngine(nu=nu, ids=spheres))
    if physics["quadratic_drag"] > 0.0:
        rho = 2.0 * physics["quadratic_drag"] * mass / (math.pi * radius**2)
        made.append(DragEngine(Rho=rho, Cd=1.0, ids=spheres))
    return made


def gravity_vector(physics: dict[str, Any]) -> Any:
    """Acceleration (3,) of free fall [m/s2]."""
    return physics["gravity"] * np.array(physics["gravity_direction"])


def frictions(walls: list[Wall]) -> dict[str, Any]:
    """Friction of the walls that have one of their own, as an argument of YADE's functors."""
    grains = len(O.materials) - 1  # whose material was added last
    own = {
        (wall.material, grains, wall.friction_angle)
        for wall in walls
        if wall.friction_angle is not None
    }
    return {"frictAngle": MatchMaker(matches=sorted(own), algo="min")} if own else {}


def contact_law(physics: dict[str, Any], friction: dict[str, Any]) -> tuple[list[Any], list[Any]]:
    """What makes a contact's stiffness, and what its force."""
    if physics["contact_law"] == "hertz":
        # YADE's pull of 4 pi R* gamma is that of the work of adhesion 2 gamma.
        energy = physics["adhesion_energy"]
        made = Ip2_FrictMat_FrictMat_MindlinPhys(
            en=physics["restitution"], gamma=energy / 2, **friction
        )
        return [made], [Law2_ScGeom_MindlinPhys_Mindlin(includeAdhesion=energy > 0.0)]
    made = Ip2_FrictMat_FrictMat_FrictPhys(**friction)
    return [made], [Law2_ScGeom_FrictPhys_CundallStrack()]
