"""Moves the grains inside YADE: reads `setup.npz` and `.json`, writes `result.npz` and `.json`.

Run as `yade -n -x -j1 yade_script.py DIRECTORY`, in YADE's own Python, so without imports of
this project; `fidelity.exchange` says what is in the files. Contacts are linear with Coulomb
friction (Cundall & Strack 1979, doi:10.1680/geot.1979.29.1.47).

Nothing here is called every step: the grains are looked at every `CHECK_S`, and the moving
walls get the velocity that puts them where the motion law wants them at the next look.
"""

import json
import math
import os
import sys
from dataclasses import dataclass, field
from pathlib import Path
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

# Time between two looks at the grains [s]. A grain's exit is interpolated between two looks;
# at 1 m/s and more a change of speed by 0.5 m/s in between costs less than 0.1 ms.
CHECK_S = 1e-3
CHECKS_PER_HEALTH = 5  # looks at energy and overlap cost more, and are made at every 5th check

GRAINS, WALLS = 1, 2  # collision groups: walls are in both, and not checked against each other
WHITE = (1.0, 1.0, 1.0)  # without a colour, YADE draws one and reseeds Python's generator

# Reach of the neighbour search in units of the smallest radius; 0.05 to 0.3 are alike.
VERLET = 0.1

# A run is broken when two bodies overlap by more than this [smallest radius]: beyond 1 a sphere's
# centre is through the wall.
MAX_OVERLAP = 0.8
# ... or when the grains move with more than this multiple of the energy that they can have.
ENERGY_MARGIN = 2.0

# Settled: for this long [s] the grains move with less, per grain, than this part of the energy
# that lifts a grain by its smallest radius, and forces are balanced to this part.
SETTLED_S = 0.05
SETTLED_ENERGY = 1e-3
SETTLED_IMBALANCE = 0.05


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


@dataclass
class Health:
    """What the checks saw."""

    max_overlap: float = 0.0  # [smallest radius]
    max_kinetic_energy: float = 0.0  # [J]
    quiet_since: float | None = None  # [s]
    why: str | None = None  # the run is broken, and why


@dataclass
class Snapshots:
    """Snapshots taken and times still to come."""

    due: list[float]
    times: list[float] = field(default_factory=list)
    positions: list[Any] = field(default_factory=list)
    orientations: list[Any] = field(default_factory=list)
    speeds: list[Any] = field(default_factory=list)


def main(directory: Path) -> None:
    """Read the setup, move the grains, write the result."""
    given = json.loads((directory / "setup.json").read_text(encoding="utf-8"))
    with np.load(directory / "setup.npz", allow_pickle=False) as stored:
        given.update({name: stored[name] for name in stored.files})
    moving = add_walls(given)
    grains = add_grains(given)
    O.dt = timestep(given)
    O.engines = engines(given)
    write_result(directory, *move(given, grains, moving))


def timestep(given: dict[str, Any]) -> float:
    """Time step [s]: a part of r_min sqrt(density / E)."""
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


def add_walls(given: dict[str, Any]) -> list[Any]:
    """Add all triangles; the states of those that move."""
    material = add_material(given["wall_material"])
    moving = []
    for i, wall in enumerate(given["walls"]):
        vertices = given[f"wall_vertices_{i}"].tolist()
        for triangle in given[f"wall_triangles_{i}"].astype(int).tolist():
            corners = [Vector3(*vertices[k]) for k in triangle]
            facet = utils.facet(corners, material=material, color=WHITE, mask=GRAINS | WALLS)
            O.bodies.append(facet)
            if wall["moves"]:
                moving.append(facet.state)
    return moving


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
            dampGravity=physics["damp_gravity"],
        ),
    ]
    trace = given["engine"].get("trace")
    if trace is not None:
        period = max(1, round(given["engine"]["trace_period"] / O.dt))
        recorders = ["spheres", "facets", "velocity"]
        made.append(VTKRecorder(fileName=trace, recorders=recorders, iterPeriod=period))
    return made


def move(
    given: dict[str, Any], grains: Grains, moving: list[Any]
) -> tuple[Grains, Health, Snapshots, float]:
    """Step until the end; also gives the number of spheres moved, summed over the steps."""
    health = Health()
    snapshots = Snapshots(sorted(given["snapshot_times"].tolist()))
    steps_left = math.ceil(given["duration"] / O.dt)
    per_check = max(1, int(CHECK_S / O.dt))
    per_grain = len(given["grain_radii"])
    sphere_steps, check = 0.0, 0
    while steps_left > 0 and grains.numbers and health.why is None:
        steps = min(per_check, steps_left)
        drive(given, moving, steps * O.dt)
        for _ in range(steps):
            O.step()
        steps_left -= steps
        sphere_steps += float(steps * per_grain * len(grains.numbers))
        let_out(given, grains, steps * O.dt)
        check += 1
        if check % CHECKS_PER_HEALTH == 0 or steps_left == 0:
            examine(given, grains, health)
        take_snapshots(snapshots, grains)
        if ends_early(given, grains, health):
            break
    record(grains)
    return grains, health, snapshots, sphere_steps


def drive(given: dict[str, Any], moving: list[Any], interval: float) -> None:
    """Set the velocity that takes the moving walls to where they belong after `interval` [s]."""
    times, displacements = given["motion_times"], given["motion_displacements"]
    if not (moving and len(times)):
        return
    now = float(O.time)
    goal = float(np.interp(now + interval, times, displacements))
    for state in moving:
        state.vel = Vector3((goal - float(state.displ()[0])) / interval, 0.0, 0.0)


def let_out(given: dict[str, Any], grains: Grains, interval: float) -> None:
    """Take out the grains that fell below the exit since the last check, `interval` [s] ago."""
    exit_z = given["exit_z"]
    staying = []
    for i in grains.numbers:
        z = float(grains.states[i].pos[2])
        if z >= exit_z:
            grains.z[i] = z
            staying.append(i)
            continue
        before = grains.z[i] - exit_z
        fraction = before / (grains.z[i] - z) if before > 0 else 0.0
        grains.exit_times[i] = float(O.time) - (1.0 - fraction) * interval
        grains.z[i] = z
        record_one(grains, i)
        O.bodies.erase(grains.ids[i], True)
    grains.numbers = staying


def examine(given: dict[str, Any], grains: Grains, health: Health) -> None:
    """Look at energy and overlap; note what is broken."""
    energy = float(utils.kineticEnergy())
    overlap = float(utils.maxOverlapRatio())
    health.max_kinetic_energy = max(health.max_kinetic_energy, energy)
    health.max_overlap = max(health.max_overlap, overlap)
    limit = ENERGY_MARGIN * available_energy(given, grains)
    if not math.isfinite(energy) or not np.isfinite(grains.z).all():
        health.why = "a position or velocity is not a number"
    elif energy > limit:
        health.why = (
            f"exploded at {float(O.time):.4g} s: kinetic energy {energy:.3g} J is above "
            f"{limit:.3g} J, {ENERGY_MARGIN:g} times what the grains can have"
        )
    elif overlap > MAX_OVERLAP:
        health.why = (
            f"overlap {overlap:.2f} of the smallest radius at {float(O.time):.4g} s is above "
            f"{MAX_OVERLAP:g}; use stiffer grains or a shorter time step"
        )
    quiet = energy < SETTLED_ENERGY * len(grains.numbers) * lift_energy(given)
    if not quiet or float(utils.unbalancedForce()) > SETTLED_IMBALANCE:
        health.quiet_since = None
    elif health.quiet_since is None:
        health.quiet_since = float(O.time)


def lift_energy(given: dict[str, Any]) -> float:
    """Energy that lifts a grain by its smallest radius [J]."""
    weight = given["grain_mass"] * given["physics"]["gravity"]
    return float(weight * given["grain_radii"].min())


def available_energy(given: dict[str, Any], grains: Grains) -> float:
    """Energy that the grains still there can have [J].

    What their fall released; twice the fastest wall's velocity, from a bounce off it; and the
    overlaps of the start, taken as a lift by one radius.
    """
    here = grains.numbers
    mass, gravity = given["grain_mass"], given["physics"]["gravity"]
    fallen = float((grains.start_z[here] - grains.z[here]).sum())
    times, displacements = given["motion_times"], given["motion_displacements"]
    fastest = float(np.abs(np.diff(displacements) / np.diff(times)).max(initial=0.0))
    bounce = 0.5 * mass * (2.0 * fastest) ** 2 * len(here)
    start = bounce + lift_energy(given) * len(here)
    return float(start + max(0.0, mass * gravity * fallen))


def ends_early(given: dict[str, Any], grains: Grains, health: Health) -> bool:
    """Whether the grains are at rest, or none can still pass."""
    now = float(O.time)
    if given["settle"] and health.quiet_since is not None:
        return now - health.quiet_since >= SETTLED_S
    if now > given["idle_after"]:
        return not (grains.z[grains.numbers] < given["idle_above_z"]).any()
    return False


def record_one(grains: Grains, i: int) -> None:
    """Keep where grain `i` is and how it moves."""
    state = grains.states[i]
    turn = state.ori * grains.frames[i]
    grains.positions[i] = [float(v) for v in state.pos]
    grains.velocities[i] = [float(v) for v in state.vel]
    x, y, z, w = (float(turn[k]) for k in range(4))
    grains.orientations[i] = w, x, y, z


def record(grains: Grains) -> None:
    """Keep where the grains still there are and how they move."""
    for i in grains.numbers:
        record_one(grains, i)


def take_snapshots(snapshots: Snapshots, grains: Grains) -> None:
    """Take the snapshots that are due: at the first check after their time."""
    while snapshots.due and float(O.time) >= snapshots.due[0]:
        snapshots.due.pop(0)
        record(grains)
        gone = np.ones(len(grains.ids), dtype=bool)
        gone[grains.numbers] = False
        speeds = np.linalg.norm(grains.velocities, axis=1)
        snapshots.times.append(float(O.time))
        for kept, values in (
            (snapshots.positions, grains.positions),
            (snapshots.orientations, grains.orientations),
            (snapshots.speeds, speeds),
        ):
            copy = values.copy()
            copy[gone] = np.nan
            kept.append(copy)


def write_result(
    directory: Path, grains: Grains, health: Health, snapshots: Snapshots, sphere_steps: float
) -> None:
    """Write what became of the grains."""
    arrays = {
        "exit_times": grains.exit_times,
        "positions": grains.positions,
        "orientations": grains.orientations,
        "velocities": grains.velocities,
    }
    if snapshots.times:
        arrays["snapshot_times"] = np.array(snapshots.times)
        arrays["snapshot_positions"] = np.array(snapshots.positions)
        arrays["snapshot_orientations"] = np.array(snapshots.orientations)
        arrays["snapshot_speeds"] = np.array(snapshots.speeds)
    np.savez(directory / "result.npz", **arrays)
    scalars = {
        "status": "finished" if health.why is None else "crashed",
        "why": health.why,
        "end_time": float(O.time),
        "steps": int(O.iter),
        "sphere_steps": sphere_steps,
        "timestep": float(O.dt),
        "max_overlap": health.max_overlap,
        "max_kinetic_energy": health.max_kinetic_energy,
    }
    (directory / "result.json").write_text(json.dumps(scalars), encoding="utf-8")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)  # YADE's own way out takes most of a second
