"""Moves the grains inside YADE: reads `setup.npz` and `.json`, writes `result.npz` and `.json`.

Run by `fidelity.engines.yade.engine` in YADE's own Python, so of this project it may import only
what needs no more than numpy; `fidelity.engines.exchange` says what is in the files.

Nothing here is called every step: the grains are looked at every `CHECK_S`, and the moving
walls get the velocities that put them where their motions want them at the next look.
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
from yade.minieigenHP import Vector3

# YADE knows only where this file is.
sys.path.append(str(Path(sys.argv[0]).resolve().parents[3]))
from fidelity.engine import MAX_OVERLAP, SETTLED_ENERGY, SETTLED_S
from fidelity.engines.exchange import read_samples
from fidelity.engines.wall_motion import angle_at, shift_at, top_speed
from fidelity.engines.yade.world import (
    Grains,
    Wall,
    add_grains,
    add_walls,
    engines,
    gravity_vector,
)
from fidelity.samples import Sampling, begin, look, series

# Time between two looks at the grains [s]. A grain's exit is interpolated between two looks;
# at 1 m/s and more a change of speed by 0.5 m/s in between costs less than 0.1 ms.
CHECK_S = 1e-3
CHECKS_PER_HEALTH = 5  # looks at energy and overlap cost more, and are made at every 5th check

# Times are sums of steps: a wall goes at the step nearest to its end.
HALF_STEP = 0.5  # [steps]

# A run is broken when the grains move with more than this multiple of the energy that they
# can have.
ENERGY_MARGIN = 2.0

# Settled: besides little energy, forces are balanced to this part.
SETTLED_IMBALANCE = 0.1


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
    wall_forces: list[Any] = field(default_factory=list)


def main(directory: Path) -> None:
    """Read the setup, move the grains, write the result."""
    given = json.loads((directory / "setup.json").read_text(encoding="utf-8"))
    with np.load(directory / "setup.npz", allow_pickle=False) as stored:
        given.update({name: stored[name] for name in stored.files})
    walls = add_walls(given)
    grains = add_grains(given)
    O.dt = given["engine"]["timestep"]
    O.engines = engines(given, walls)
    sampling = begin_samples(given, grains)
    health, snapshots, sphere_steps = move(given, grains, walls, sampling)
    write_result(directory, grains, health, snapshots, sampling, sphere_steps)


def move(
    given: dict[str, Any], grains: Grains, walls: list[Wall], sampling: Sampling | None
) -> tuple[Health, Snapshots, float]:
    """Step until the end; also gives the number of spheres moved, summed over the steps."""
    health = Health()
    snapshots = Snapshots(sorted(given["snapshot_times"].tolist()))
    steps_left = math.ceil(given["duration"] / O.dt)
    per_check = max(1, int(CHECK_S / O.dt))
    per_grain = len(given["grain_radii"])
    sphere_steps, check = 0.0, 0
    while steps_left > 0 and grains.numbers and health.why is None:
        remove_gone(walls)
        steps = min(per_check, steps_left, *steps_to_ends(walls))
        drive(walls, steps * O.dt)
        for _ in range(steps):
            O.step()
        steps_left -= steps
        sphere_steps += float(steps * per_grain * len(grains.numbers))
        let_out(given, grains, steps * O.dt)
        check += 1
        if check % CHECKS_PER_HEALTH == 0 or steps_left == 0:
            examine(given, grains, walls, health)
        take_snapshots(snapshots, grains, walls)
        if sampling is not None and health.why is None:
            look(sampling, float(O.time), places(grains), lambda: spheres_there(grains))
        if ends_early(given, grains, health):
            break
    record(grains)
    return health, snapshots, sphere_steps


def steps_to_ends(walls: list[Wall]) -> list[int]:
    """Steps from now until each wall that will go is to be taken out."""
    now = float(O.time)
    ends = [wall.until for wall in walls if wall.facets and wall.until < math.inf]
    return [max(1, math.ceil((end - now) / O.dt - HALF_STEP)) for end in ends]


def remove_gone(walls: list[Wall]) -> None:
    """Take out the walls whose time is over."""
    for wall in walls:
        if wall.facets and float(O.time) >= wall.until - HALF_STEP * O.dt:
            for facet in wall.facets:
                O.bodies.erase(facet.id)
            wall.facets.clear()


def drive(walls: list[Wall], interval: float) -> None:
    """Set the velocities that take the moving walls to where they belong after `interval` [s]."""
    now = float(O.time)
    for wall in walls:
        motion = wall.motion
        if motion is None or not wall.facets:
            continue
        turn = angle_at(motion, now + interval) - angle_at(motion, now)
        spin = Vector3(*motion.axis) * (turn / interval)
        goals = shift_at(motion, wall.middles, now + interval)
        for facet, goal in zip(wall.facets, goals.tolist(), strict=True):
            facet.state.vel = (Vector3(*goal) - facet.state.displ()) / interval
            facet.state.angVel = spin


def let_out(given: dict[str, Any], grains: Grains, interval: float) -> None:
    """Take out the grains that fell below the exit since the last check, `interval` [s] ago."""
    exit_z = given["exit_z"]
    staying = []
    for i in grains.numbers:
        z = float(grains.states[i].pos[2])
        if not z < exit_z:  # nor if it is not a number: that is for `examine` to find
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


def examine(given: dict[str, Any], grains: Grains, walls: list[Wall], health: Health) -> None:
    """Look at energy and overlap; note what is broken."""
    energy = float(utils.kineticEnergy())
    overlap = largest_overlap(grains, walls)
    health.max_kinetic_energy = max(health.max_kinetic_energy, energy)
    health.max_overlap = max(health.max_overlap, overlap)
    limit = ENERGY_MARGIN * available_energy(given, grains, walls)
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
    quiet = energy < SETTLED_ENERGY * lift_energy(given, grains)
    if not quiet or float(utils.unbalancedForce()) > SETTLED_IMBALANCE:
        health.quiet_since = None
    elif health.quiet_since is None:
        health.quiet_since = float(O.time)


def largest_overlap(grains: Grains, walls: list[Wall]) -> float:
    """Largest overlap now, in units of the smallest radius; of a pair, of the mean of its radii.

    YADE looks at pairs of spheres only, and relates the overlap to that mean.
    """
    depths = [
        float(contact.geom.penetrationDepth)
        for wall in walls
        for facet in wall.facets
        for contact in facet.intrs()
        if contact.isReal
    ]
    in_walls = max(depths, default=0.0) / grains.r_min
    return max(float(utils.maxOverlapRatio()), in_walls)


def lift_energy(given: dict[str, Any], grains: Grains) -> float:
    """Energy that lifts the grains still there by the smallest radius [J]."""
    mass = float(grains.masses[grains.numbers].sum())
    return float(mass * given["physics"]["gravity"] * grains.r_min)


def available_energy(given: dict[str, Any], grains: Grains, walls: list[Wall]) -> float:
    """Energy that the grains still there can have [J].

    What their fall released; twice the fastest velocity of walls or start, from a bounce; the
    turning that they came with; and the overlaps of the start, taken as a lift by one radius.
    """
    here = grains.numbers
    masses, now = grains.masses[here], [list(map(float, grains.states[i].pos)) for i in here]
    way = np.array(now).reshape(-1, 3) - given["positions"][here]
    fallen = float((masses * (way @ gravity_vector(given["physics"]))).sum())
    fastest = max([grains.start_speed, *(top_speed(w.motion, w.vertices) for w in walls)])
    bounce = 0.5 * float(masses.sum()) * (2.0 * fastest) ** 2
    start = bounce + float(grains.start_spin[here].sum()) + lift_energy(given, grains)
    return float(start + max(0.0, fallen))


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
    grains.angular_velocities[i] = [float(v) for v in state.angVel]
    x, y, z, w = (float(turn[k]) for k in range(4))
    grains.orientations[i] = w, x, y, z


def record(grains: Grains) -> None:
    """Keep where the grains still there are and how they move."""
    for i in grains.numbers:
        record_one(grains, i)


def take_snapshots(snapshots: Snapshots, grains: Grains, walls: list[Wall]) -> None:
    """Take the snapshots that are due: at the first check after their time."""
    while snapshots.due and float(O.time) >= snapshots.due[0]:
        snapshots.due.pop(0)
        record(grains)
        gone = np.ones(len(grains.ids), dtype=bool)
        gone[grains.numbers] = False
        speeds = np.linalg.norm(grains.velocities, axis=1)
        snapshots.times.append(float(O.time))
        snapshots.wall_forces.append(forces_on(walls))
        for kept, values in (
            (snapshots.positions, grains.positions),
            (snapshots.orientations, grains.orientations),
            (snapshots.speeds, speeds),
        ):
            copy = values.copy()
            copy[gone] = np.nan
            kept.append(copy)


def begin_samples(given: dict[str, Any], grains: Grains) -> Sampling | None:
    """Begin to reduce what is asked for; None if nothing is."""
    samples = read_samples(given)
    if samples is None:
        return None
    return begin(samples, given["positions"], lambda: spheres_there(grains))


def places(grains: Grains) -> Any:
    """Mass centres (n, 3) [m] now; of a grain that left, where it was found to have left."""
    now = grains.positions.copy()
    for i in grains.numbers:
        now[i] = [float(v) for v in grains.states[i].pos]
    return now


def spheres_there(grains: Grains) -> Any:
    """Centres and radii (m, 4) [m] of the spheres of the grains still there."""
    spheres = []
    for i in grains.numbers:
        for member in O.bodies[grains.ids[i]].shape.members:
            sphere = O.bodies[member]
            spheres.append([*(float(v) for v in sphere.state.pos), float(sphere.shape.radius)])
    return np.array(spheres).reshape(-1, 4)


def forces_on(walls: list[Wall]) -> Any:
    """What the grains exert on each wall (w, 3) [N]."""
    forces = np.zeros((len(walls), 3))
    for i, wall in enumerate(walls):
        for facet in wall.facets:
            forces[i] += [float(part) for part in O.forces.f(facet.id)]
    return forces


def write_result(
    directory: Path,
    grains: Grains,
    health: Health,
    snapshots: Snapshots,
    sampling: Sampling | None,
    sphere_steps: float,
) -> None:
    """Write what became of the grains."""
    arrays = {
        "exit_times": grains.exit_times,
        "positions": grains.positions,
        "orientations": grains.orientations,
        "velocities": grains.velocities,
        "angular_velocities": grains.angular_velocities,
    }
    if snapshots.times:
        arrays["snapshot_times"] = np.array(snapshots.times)
        arrays["snapshot_positions"] = np.array(snapshots.positions)
        arrays["snapshot_orientations"] = np.array(snapshots.orientations)
        arrays["snapshot_speeds"] = np.array(snapshots.speeds)
        arrays["snapshot_wall_forces"] = np.array(snapshots.wall_forces)
    if sampling is not None:
        there, finished = lambda: spheres_there(grains), health.why is None
        arrays |= series(sampling, grains.masses, there, finished=finished)
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
