"""Moves the grains inside YADE: reads the setup that `fidelity.engines.exchange` wrote.

Run by `fidelity.engines.yade.engine` in YADE's own Python, so of this project it may import only
what needs no more than numpy.

Nothing here is called every step: the grains are looked at every `CHECK_S`, and the moving
walls get the velocities that put them where their motions want them at the next look.
"""

import math
import os
import sys
from pathlib import Path

import numpy as np
from yade import O, utils
from yade.minieigenHP import Vector3

# YADE knows only where this file is.
sys.path.append(str(Path(sys.argv[0]).resolve().parents[3]))
from fidelity.engine import MAX_OVERLAP, SETTLED_ENERGY, Setup, smallest_radius
from fidelity.engines.exchange import read_setup, write_movement
from fidelity.engines.looks import (
    Seen,
    begin_samples,
    ends_early,
    first_look,
    movement,
    sample,
    take_snapshots,
)
from fidelity.engines.wall_motion import angle_at, given_speed, shift_at
from fidelity.engines.yade.world import (
    Grains,
    Wall,
    add_grains,
    add_walls,
    engines,
    gravity_vector,
)
from mfopt.arrays import Array

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


def main(directory: Path) -> None:
    """Read the setup, move the grains, write the result."""
    setup, engine = read_setup(directory)
    walls, grains = add_walls(setup), add_grains(setup)
    O.dt = engine["timestep"]
    O.engines = engines(setup, walls, engine)
    seen = first_look(setup)
    begin_samples(setup, seen, lambda: spheres_there(grains, seen))
    move(setup, grains, walls, seen)
    moved = movement(
        setup, seen, lambda: spheres_there(grains, seen),
        end_time=float(O.time), steps=int(O.iter), timestep=float(O.dt),
    )  # fmt: skip
    write_movement(moved, directory)


def move(setup: Setup, grains: Grains, walls: list[Wall], seen: Seen) -> None:
    """Step until the end."""
    steps_left = math.ceil(setup.duration / O.dt)
    per_check = max(1, int(CHECK_S / O.dt))
    per_grain = len(setup.grain.radii)
    check = 0
    while steps_left > 0 and seen.there and seen.why is None:
        remove_gone(walls)
        steps = min(per_check, steps_left, *steps_to_ends(walls))
        drive(walls, steps * O.dt)
        for _ in range(steps):
            O.step()
        steps_left -= steps
        seen.sphere_steps += float(steps * per_grain * len(seen.there))
        let_out(setup, grains, seen, steps * O.dt)
        check += 1
        if check % CHECKS_PER_HEALTH == 0 or steps_left == 0:
            examine(setup, grains, walls, seen)
        now = float(O.time)
        take_snapshots(
            seen, now, lambda: record(grains, seen), wall_forces=lambda: forces_on(walls)
        )
        sample(seen, now, lambda: places(grains, seen), lambda: spheres_there(grains, seen))
        if ends_early(setup, seen, now, grains.z[seen.there]):
            break
    record(grains, seen)


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


def let_out(setup: Setup, grains: Grains, seen: Seen, interval: float) -> None:
    """Take out the grains that fell below the exit since the last check, `interval` [s] ago."""
    exit_z = setup.exit_z
    staying = []
    for i in seen.there:
        z = float(grains.states[i].pos[2])
        if not z < exit_z:  # nor if it is not a number: that is for `examine` to find
            grains.z[i] = z
            staying.append(i)
            continue
        before = grains.z[i] - exit_z
        fraction = before / (grains.z[i] - z) if before > 0 else 0.0
        seen.exit_times[i] = float(O.time) - (1.0 - fraction) * interval
        grains.z[i] = z
        record_one(grains, seen, i)
        O.bodies.erase(grains.ids[i], True)
    seen.there = staying


def examine(setup: Setup, grains: Grains, walls: list[Wall], seen: Seen) -> None:
    """Look at energy and overlap; note what is broken."""
    energy = float(utils.kineticEnergy())
    overlap = largest_overlap(setup, walls)
    seen.max_kinetic_energy = max(seen.max_kinetic_energy, energy)
    seen.max_overlap = max(seen.max_overlap, overlap)
    limit = ENERGY_MARGIN * available_energy(setup, grains, walls, seen)
    if not math.isfinite(energy) or not np.isfinite(grains.z).all():
        seen.why = "a position or velocity is not a number"
    elif energy > limit:
        seen.why = (
            f"exploded at {float(O.time):.4g} s: kinetic energy {energy:.3g} J is above "
            f"{limit:.3g} J, {ENERGY_MARGIN:g} times what the grains can have"
        )
    elif overlap > MAX_OVERLAP:
        seen.why = (
            f"overlap {overlap:.2f} of the smallest radius at {float(O.time):.4g} s is above "
            f"{MAX_OVERLAP:g}; use stiffer grains or a shorter time step"
        )
    quiet = energy < SETTLED_ENERGY * lift_energy(setup, grains, seen)
    if not quiet or float(utils.unbalancedForce()) > SETTLED_IMBALANCE:
        seen.quiet_since = None
    elif seen.quiet_since is None:
        seen.quiet_since = float(O.time)


def largest_overlap(setup: Setup, walls: list[Wall]) -> float:
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
    in_walls = max(depths, default=0.0) / smallest_radius(setup)
    return max(float(utils.maxOverlapRatio()), in_walls)


def lift_energy(setup: Setup, grains: Grains, seen: Seen) -> float:
    """Energy that lifts the grains still there by the smallest radius [J]."""
    mass = float(grains.masses[seen.there].sum())
    return float(mass * setup.physics.gravity * smallest_radius(setup))


def available_energy(setup: Setup, grains: Grains, walls: list[Wall], seen: Seen) -> float:
    """Energy that the grains still there can have [J].

    What their fall released; twice the fastest velocity of walls or start, from a bounce; the
    turning that they came with; and the overlaps of the start, taken as a lift by one radius.
    """
    here = seen.there
    masses, now = grains.masses[here], [list(map(float, grains.states[i].pos)) for i in here]
    way = np.array(now).reshape(-1, 3) - setup.packing.positions[here]
    fallen = float((masses * (way @ gravity_vector(setup.physics))).sum())
    bounce = 0.5 * float(masses.sum()) * (2.0 * given_speed(setup)) ** 2
    start = bounce + float(grains.start_spin[here].sum()) + lift_energy(setup, grains, seen)
    return float(start + max(0.0, fallen))


def record_one(grains: Grains, seen: Seen, i: int) -> None:
    """Keep where grain `i` is and how it moves."""
    state = grains.states[i]
    turn = state.ori * grains.frames[i]
    seen.positions[i] = [float(v) for v in state.pos]
    seen.velocities[i] = [float(v) for v in state.vel]
    seen.angular_velocities[i] = [float(v) for v in state.angVel]
    x, y, z, w = (float(turn[k]) for k in range(4))
    seen.orientations[i] = w, x, y, z


def record(grains: Grains, seen: Seen) -> None:
    """Keep where the grains still there are and how they move."""
    for i in seen.there:
        record_one(grains, seen, i)


def places(grains: Grains, seen: Seen) -> Array:
    """Mass centres (n, 3) [m] now; of a grain that left, where it was found to have left."""
    now = seen.positions.copy()
    for i in seen.there:
        now[i] = [float(v) for v in grains.states[i].pos]
    return now


def spheres_there(grains: Grains, seen: Seen) -> Array:
    """Centres and radii (m, 4) [m] of the spheres of the grains still there."""
    spheres = []
    for i in seen.there:
        for member in O.bodies[grains.ids[i]].shape.members:
            sphere = O.bodies[member]
            spheres.append([*(float(v) for v in sphere.state.pos), float(sphere.shape.radius)])
    return np.array(spheres).reshape(-1, 4)


def forces_on(walls: list[Wall]) -> Array:
    """What the grains exert on each wall (w, 3) [N]."""
    forces = np.zeros((len(walls), 3))
    for i, wall in enumerate(walls):
        for facet in wall.facets:
            forces[i] += [float(part) for part in O.forces.f(facet.id)]
    return forces


if __name__ == "__main__":
    main(Path(sys.argv[1]))
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)  # YADE's own way out takes most of a second
