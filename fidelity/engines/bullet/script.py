"""One Bullet run in a process of its own: `python -m fidelity.engines.bullet.script DIRECTORY`.

Reads the setup that `fidelity.engines.exchange` wrote into DIRECTORY, moves the grains, and leaves
the movement there.
"""

import math
import sys
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fidelity.dem.state import rotation_matrices
from fidelity.engine import Movement, Setup, sizes, smallest_radius
from fidelity.engines.bullet.world import (
    World,
    build,
    place_walls,
    read_heights,
    read_overlaps,
    read_poses,
    read_velocities,
    start,
)
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
from fidelity.engines.wall_motion import given_speed
from mfopt.arrays import Array

CHECK_EVERY = 20  # [steps] energy, overlap, rest: reading all contacts costs as much as a step

# [smallest radius] Rigid grains overlap by 0.1 to 0.5 in flow; a few that a moving wall pinches
# against a fixed edge overlap deeper, for nothing breaks. Too many of them mean a broken run.
OVERLAP_LIMIT = 1.0
DEEP_SHARE = 0.05  # of the grains may overlap deeper than that,
DEEP_FEW = 3  # or this many if that is more

# Kinetic energy may exceed what gravity and walls gave by this factor.
ENERGY_MARGIN = 1.5

# Root mean square speed of a pile at rest, in units of sqrt(g r_min); never below what gravity
# adds in one step, which the solver does not resolve.
REST_SPEED = 0.1


@dataclass
class Bodies:
    """The bodies of the grains still there, in the order of `Seen.there`."""

    numbers: list[int]  # PyBullet's
    heights: Array  # (m,) [m] after the last step


def move(setup: Setup, *, timestep: float, iterations: int) -> Movement:
    """Move the grains of `setup`.

    Args:
        setup: grains, walls, physics.
        timestep: longest step wanted [s]; see `safe_timestep`.
        iterations: of the contact solver, per step.
    """
    import pybullet as p

    dt = safe_timestep(setup, timestep)
    world = build(p, setup, timestep=dt, iterations=iterations)
    bodies = Bodies(list(world.grains), setup.packing.positions[:, 2].copy())
    seen, step = first_look(setup), 0
    seen.quiet_since = 0.0
    keep, spheres = partial(_keep_state, p, bodies, seen), partial(spheres_there, setup, seen)
    begin_samples(setup, seen, spheres)
    for step in range(1, math.ceil(setup.duration / dt - 1e-9) + 1):
        _advance(p, world, setup, bodies, seen, (step - 1) * dt, dt)
        if step % CHECK_EVERY == 0:
            _examine(p, setup, bodies, seen, step * dt, dt)
        take_snapshots(seen, step * dt, keep)
        sample(seen, step * dt, lambda: keep().copy(), spheres)
        if (
            seen.why is not None
            or not seen.there
            or ends_early(setup, seen, step * dt, bodies.heights)
        ):
            break
    if seen.why is None:
        _examine(p, setup, bodies, seen, step * dt, dt)
    p.disconnect(world.client)
    return movement(setup, seen, spheres, end_time=step * dt, steps=step, timestep=dt)


def safe_timestep(setup: Setup, timestep: float) -> float:
    """The step [s], shortened so that no grain falls, flies or is pushed half its radius within it.

    Slower than that, no sphere passes through a wall between two steps.
    """
    if not setup.walls:
        return timestep
    lowest = max(setup.exit_z, min(float(np.min(wall.vertices[:, 2])) for wall in setup.walls))
    height = max(0.0, float(np.max(setup.packing.positions[:, 2])) - lowest)
    fastest = max(math.sqrt(2.0 * setup.physics.gravity * height), given_speed(setup))
    within = 0.5 * smallest_radius(setup)
    return min(timestep, within / fastest) if fastest > 0.0 else timestep


def spheres_there(setup: Setup, seen: Seen) -> Array:
    """Centres and radii (m, 4) [m] of the spheres of the grains still there."""
    there, grain = seen.there, setup.grain
    scales = sizes(setup.packing)[there][:, None, None]
    quaternions = seen.orientations[there]
    lengths = np.linalg.norm(quaternions, axis=1, keepdims=True)
    turns = rotation_matrices(quaternions / lengths)
    arms = scales * np.einsum("nij,kj->nki", turns, grain.offsets)
    radii = scales * grain.radii[:, None]  # (n, k, 1)
    centres = seen.positions[there][:, None] + arms
    return np.concatenate([centres, radii], axis=2).reshape(-1, 4)


def _advance(
    p: Any, world: World, setup: Setup, bodies: Bodies, seen: Seen, time: float, dt: float
) -> None:
    """One step from `time` to `time + dt`; grains that fell below `exit_z` leave."""
    # Contacts are found where a wall is now and solved for where it will be.
    place_walls(p, world, time, dt)
    p.stepSimulation()
    seen.sphere_steps += float(len(seen.there) * setup.grain.radii.size)
    before, bodies.heights = bodies.heights, read_heights(p, bodies.numbers)
    below = np.flatnonzero(bodies.heights < setup.exit_z)
    if below.size == 0:
        return
    _keep_state(p, bodies, seen)
    # Within the step the fall is a straight line: the error is below g dt^2 / 8 = 1.3 um.
    part = (before[below] - setup.exit_z) / (before[below] - bodies.heights[below])
    seen.exit_times[np.array(seen.there)[below]] = time + dt * np.clip(part, 0.0, 1.0)
    for i in reversed(below.tolist()):
        p.removeBody(bodies.numbers.pop(i))
        seen.there.pop(i)
    bodies.heights = np.delete(bodies.heights, below)


def _keep_state(p: Any, bodies: Bodies, seen: Seen) -> Array:
    """Bring places and velocities up to date; the mass centres (n, 3) [m]."""
    there = seen.there
    seen.positions[there], seen.orientations[there] = read_poses(p, bodies.numbers)
    seen.velocities[there], seen.angular_velocities[there] = read_velocities(p, bodies.numbers)
    return seen.positions


def _examine(p: Any, setup: Setup, bodies: Bodies, seen: Seen, time: float, dt: float) -> None:
    """Look at energy and overlap; note what is broken, and whether the grains are at rest."""
    _keep_state(p, bodies, seen)
    if not np.all(np.isfinite(seen.positions)):
        seen.why = f"the position of a grain is not a number at {time:.4f} s; shorten timestep"
        return
    there = seen.there
    energy = kinetic_energy(
        setup, there, seen.velocities[there], seen.angular_velocities[there],
        seen.orientations[there],
    )  # fmt: skip
    r_min = smallest_radius(setup)
    overlaps, pairs = read_overlaps(p)
    deep = np.unique(pairs[overlaps > OVERLAP_LIMIT * r_min])
    seen.max_kinetic_energy = max(seen.max_kinetic_energy, energy)
    seen.max_overlap = max(seen.max_overlap, float(np.max(overlaps, initial=0.0)) / r_min)
    mass = setup.grain.mass * float(np.sum(sizes(setup.packing)[there] ** 3))
    if energy > 0.5 * mass * rest_speed(setup, dt) ** 2:
        seen.quiet_since = time
    limit = ENERGY_MARGIN * available_energy(setup, seen.positions)
    deep_grains, grains = int(np.isin(bodies.numbers, deep).sum()), seen.exit_times.size
    if energy > limit:
        seen.why = (
            f"kinetic energy {energy:.3g} J at {time:.4f} s exceeds {ENERGY_MARGIN:g} times "
            f"what gravity and walls gave, {limit:.3g} J; shorten timestep"
        )
    elif deep_grains > max(DEEP_SHARE * grains, DEEP_FEW):
        seen.why = (
            f"{deep_grains} of {grains} grains overlap by more than {OVERLAP_LIMIT:g} "
            f"smallest radii at {time:.4f} s; shorten timestep or raise iterations"
        )


def rest_speed(setup: Setup, dt: float) -> float:
    """Root mean square speed [m/s] below which the grains count as resting."""
    gravity, r_min = setup.physics.gravity, smallest_radius(setup)
    return max(REST_SPEED * math.sqrt(gravity * r_min), gravity * dt)


def kinetic_energy(
    setup: Setup, grains: list[int], velocities: Array, spins: Array, orientations: Array
) -> float:
    """Energy of motion and of spin [J] of the grains numbered `grains` (g,).

    Args:
        setup: their mass and inertia.
        grains: their numbers.
        velocities: (g, 3) [m/s].
        spins: angular velocities (g, 3) [rad/s].
        orientations: (g, 4).
    """
    scales, q = sizes(setup.packing)[grains][:, None], orientations
    # Spin in the grain's frame: rotated by the conjugate quaternion.
    twice = 2.0 * np.cross(spins, q[:, 1:])
    own = spins + q[:, :1] * twice + np.cross(twice, q[:, 1:])  # (g, 3)
    motion = setup.grain.mass * float(np.sum(scales**3 * velocities**2))
    return 0.5 * (motion + float(np.sum(scales**5 * setup.grain.inertia * own**2)))


def available_energy(setup: Setup, positions: Array) -> float:
    """Most energy [J] that the fall so far, a grain's own height, walls and start can have given.

    A wall of speed w throws a grain back at 2 w at most.
    """
    scales, packing = sizes(setup.packing), setup.packing
    masses = setup.grain.mass * scales**3
    drop = float(np.sum(masses * (packing.positions[:, 2] - positions[:, 2])))
    reach = float(np.max(setup.grain.radii) + np.max(np.abs(setup.grain.offsets)))
    own_height = reach * float(np.sum(masses * scales))
    by_gravity = setup.physics.gravity * (max(drop, 0.0) + own_height)
    by_walls = 0.5 * float(np.sum(masses)) * (2.0 * given_speed(setup)) ** 2
    still, spins = np.zeros_like(positions), start(setup)[1]
    by_spin = kinetic_energy(setup, list(range(len(scales))), still, spins, packing.orientations)
    return by_gravity + by_walls + by_spin


def main(directory: Path) -> None:
    """Read the setup in `directory`, move the grains, write the movement there."""
    setup, engine = read_setup(directory)
    movement = move(setup, timestep=engine["timestep"], iterations=engine["iterations"])
    write_movement(movement, directory)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
