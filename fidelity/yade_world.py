"""The scene of a run inside YADE: walls as facets, grains as clumps, and what a step does.

Part of `fidelity.yade_script`, so without other imports of this project. Contacts are linear
with Coulomb friction (Cundall & Strack 1979, doi:10.1680/geot.1979.29.1.47).
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
    ForceResetter,
    FrictMat,
    Ig2_Facet_Sphere_ScGeom,
    Ig2_Sphere_Sphere_ScGeom,
    InsertionSortCollider,
    InteractionLoop,
    Ip2_FrictMat_FrictMat_FrictPhys,
    Law2_ScGeom_FrictPhys_CundallStrack,
    NewtonIntegrator,
    VTKRecorder,
)

GRAINS, WALLS = 1, 2  # collision groups: walls are in both, and not checked against each other
WHITE = (1.0, 1.0, 1.0)  # without a colour, YADE draws one and reseeds Python's generator

# Reach of the neighbour search in units of the smallest radius; 0.05 to 0.3 are alike.
VERLET = 0.2


@dataclass
class Walls:
    """The triangles of the walls."""

    facets: list[Any]  # YADE's bodies
    moving: list[Any]  # the states of those that move


@dataclass
class Grains:
    """The grains that are still there, and what became of all of them."""

    numbers: list[int]  # of the grains still there
    states: list[Any]  # of all grains: YADE's State
    ids: list[int]  # of all grains: YADE's body number of the clump
    frames: list[Any]  # of all grains: rotation from the grain's frame to YADE's clump frame
    z: Any  # (n,) [m] at the last check
    start_z: Any  # (n,) [m]
    exit_times: Any  # (n,) [s]
    positions: Any  # (n, 3), (n, 4), (n, 3): filled when a grain leaves, and at the end
    orientations: Any
    velocities: Any


def timestep(given: dict[str, Any]) -> float:
    """Time step [s]: a part of r_min sqrt(density / E).

    Measured with grains of 5 spheres: in a box as soft as they are, 3 is stable and 4 is not;
    with steel walls, and a grain between a rim and an edge, 1.2 was and 1.8 was not always.
    """
    material = given["grain_material"]
    wave = math.sqrt(material["density"] / material["young_modulus"])
    return float(given["physics"]["timestep_factor"] * given["grain_radii"].min() * wave)


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


def add_walls(given: dict[str, Any]) -> Walls:
    """Add all triangles."""
    material = add_material(given["wall_material"])
    walls = Walls([], [])
    for i, wall in enumerate(given["walls"]):
        vertices = given[f"wall_vertices_{i}"].tolist()
        for triangle in given[f"wall_triangles_{i}"].astype(int).tolist():
            corners = [Vector3(*vertices[k]) for k in triangle]
            facet = utils.facet(corners, material=material, color=WHITE, mask=GRAINS | WALLS)
            O.bodies.append(facet)
            walls.facets.append(facet)
            if wall["moves"]:
                walls.moving.append(facet.state)
    return walls


def add_grains(given: dict[str, Any]) -> Grains:
    """Add the grains as clumps with the mass and the inertia that the grain has."""
    material = add_material(given["grain_material"])
    radii = given["grain_radii"].tolist()
    positions, orientations = given["positions"], given["orientations"]
    ids, states, frames = [], [], []
    for position, (w, x, y, z) in zip(positions.tolist(), orientations.tolist(), strict=True):
        turn = Quaternion(w, x, y, z)
        turn.normalize()
        members = [
            utils.sphere(
                Vector3(*position) + turn * Vector3(*offset),
                radius,
                material=material,
                color=WHITE,
                mask=GRAINS,
            )
            for offset, radius in zip(given["grain_offsets"].tolist(), radii, strict=True)
        ]
        number, _ = O.bodies.appendClumped(members, discretization=0)
        clump = O.bodies[number]
        clump.aspherical = True
        frame = clump.state.ori.conjugate() * turn
        clump.state.vel = Vector3(given["start_velocity"], 0.0, 0.0)
        clump.state.mass = given["grain_mass"]
        clump.state.inertia = clump_inertia(frame, given["grain_inertia"])
        ids.append(number)
        states.append(clump.state)
        frames.append(frame)
    n = len(ids)
    nowhere = np.full((n, 4), np.nan)
    return Grains(
        list(range(n)),
        states,
        ids,
        frames,
        z=positions[:, 2].copy(),
        start_z=positions[:, 2].copy(),
        exit_times=nowhere[:, 0].copy(),
        positions=nowhere[:, :3].copy(),
        orientations=nowhere.copy(),
        velocities=nowhere[:, :3].copy(),
    )


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


def engines(given: dict[str, Any]) -> list[Any]:
    """What YADE does in a step."""
    physics = given["physics"]
    made = [
        ForceResetter(),
        InsertionSortCollider(
            [Bo1_Sphere_Aabb(), Bo1_Facet_Aabb()],
            verletDist=-VERLET,
            avoidSelfInteractionMask=WALLS,
        ),
        InteractionLoop(
            [Ig2_Sphere_Sphere_ScGeom(), Ig2_Facet_Sphere_ScGeom()],
            [Ip2_FrictMat_FrictMat_FrictPhys()],
            [Law2_ScGeom_FrictPhys_CundallStrack()],
        ),
        NewtonIntegrator(
            damping=physics["damping"],
            gravity=Vector3(0.0, 0.0, -physics["gravity"]),
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
