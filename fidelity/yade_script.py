"""Moves the grains inside YADE: reads `setup.npz` and `.json`, writes `result.npz` and `.json`.

Run as `yade -n -x -j1 yade_script.py DIRECTORY`, in YADE's own Python, so of this project it
imports `fidelity.yade_world` alone; `fidelity.exchange` says what is in the files.

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
from yade.minieigenHP import Vector3

# YADE knows only where this file is.
sys.path.append(str(Path(sys.argv[0]).resolve().parents[1]))
from fidelity.yade_world import (
    Grains,
    Walls,
    add_grains,
    add_walls,
    engines,
    timestep,
)

# Time between two looks at the grains [s]. A grain's exit is interpolated between two looks;
# at 1 m/s and more a change of speed by 0.5 m/s in between costs less than 0.1 ms.
CHECK_S = 1e-3
CHECKS_PER_HEALTH = 5  # looks at energy and overlap cost more, and are made at every 5th check

# A run is broken when two spheres overlap by more than this [smallest radius]; at 2 their centres
# are in one place. Soft grains between the cup's rim and the hole's edge reach 1 in sound runs.
MAX_OVERLAP = 1.5
# ... or when the grains move with more than this multiple of the energy that they can have.
ENERGY_MARGIN = 2.0

# Settled: for this long [s] the grains move with less, per grain, than this part of the energy
# that lifts a grain by its smallest radius, and forces are balanced to this part.
SETTLED_S = 0.1
SETTLED_ENERGY = 1e-3
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


def main(directory: Path) -> None:
    """Read the setup, move the grains, write the result."""
    given = json.loads((directory / "setup.json").read_text(encoding="utf-8"))
    with np.load(directory / "setup.npz", allow_pickle=False) as stored:
        given.update({name: stored[name] for name in stored.files})
    walls = add_walls(given)
    grains = add_grains(given)
    O.dt = timestep(given)
    O.engines = engines(given)
    write_result(directory, *move(given, grains, walls))


def move(
    given: dict[str, Any], grains: Grains, walls: Walls
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
        drive(given, walls, steps * O.dt)
        for _ in range(steps):
            O.step()
        steps_left -= steps
        sphere_steps += float(steps * per_grain * len(grains.numbers))
        let_out(given, grains, steps * O.dt)
        check += 1
        if check % CHECKS_PER_HEALTH == 0 or steps_left == 0:
            examine(given, grains, walls, health)
        take_snapshots(snapshots, grains)
        if ends_early(given, grains, health):
            break
    record(grains)
    return grains, health, snapshots, sphere_steps


def drive(given: dict[str, Any], walls: Walls, interval: float) -> None:
    """Set the velocity that takes the moving walls to where they belong after `interval` [s]."""
    times, displacements = given["motion_times"], given["motion_displacements"]
    if not (walls.moving and len(times)):
        return
    now = float(O.time)
    goal = float(np.interp(now + interval, times, displacements))
    for state in walls.moving:
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


def examine(given: dict[str, Any], grains: Grains, walls: Walls, health: Health) -> None:
    """Look at energy and overlap; note what is broken."""
    energy = float(utils.kineticEnergy())
    overlap = largest_overlap(given, walls)
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


def largest_overlap(given: dict[str, Any], walls: Walls) -> float:
    """Largest overlap now, in units of the smallest radius.

    YADE looks at pairs of spheres only, and relates the overlap to the mean of their radii.
    """
    depths = [
        float(contact.geom.penetrationDepth)
        for facet in walls.facets
        for contact in facet.intrs()
        if contact.isReal
    ]
    in_walls = max(depths, default=0.0) / float(given["grain_radii"].min())
    return max(float(utils.maxOverlapRatio()), in_walls)


def lift_energy(given: dict[str, Any]) -> float:
    """Energy that lifts a grain by its smallest radius [J]."""
    weight = given["grain_mass"] * given["physics"]["gravity"]
    return float(weight * given["grain_radii"].min())


def available_energy(given: dict[str, Any], grains: Grains) -> float:
    """Energy that the grains still there can have [J].

    What their fall released; twice the fastest velocity of walls or start, from a bounce; and the
    overlaps of the start, taken as a lift by one radius.
    """
    here = grains.numbers
    mass, gravity = given["grain_mass"], given["physics"]["gravity"]
    fallen = float((grains.start_z[here] - grains.z[here]).sum())
    times, displacements = given["motion_times"], given["motion_displacements"]
    speeds = np.abs(np.diff(displacements) / np.diff(times))
    fastest = float(speeds.max(initial=abs(given["start_velocity"])))
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
