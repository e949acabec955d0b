"""One Bullet run in a process of its own: `python -m fidelity.engines.bullet.script DIRECTORY`.

Reads the setup that `fidelity.engines.exchange` wrote into DIRECTORY, moves the grains, and leaves
the movement there.
"""

import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fidelity.dem.state import rotation_matrices
from fidelity.engine import Movement, Setup, sizes
from fidelity.engines.bullet.world import (
    World,
    build,
    place_walls,
    read_heights,
    read_overlaps,
    read_poses,
    read_velocities,
    smallest_radius,
    start,
)
from fidelity.engines.exchange import SNAPSHOT_KEYS, read_setup, write_movement
from fidelity.engines.wall_motion import top_speed
from fidelity.samples import Sampling, begin, look, series
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
REST_TIME = 0.1  # [s] that it must last


@dataclass(slots=True)
class _Run:
    """What is known of the grains so far; grown step by step."""

    live: list[int]  # numbers of the grains that have not left
    bodies: list[int]  # their bodies
    heights: Array  # (live,) [m] their heights after the last step
    exit_times: Array
    positions: Array
    orientations: Array
    velocities: Array
    angular_velocities: Array
    sphere_steps: float = 0.0
    max_overlap: float = 0.0
    max_kinetic_energy: float = 0.0
    restless_at: float = 0.0  # [s] when the grains were last seen not to be at rest
    snapshots: list[tuple[float, Array, Array, Array]] = field(default_factory=list)
    sampling: Sampling | None = None


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
    run = _start(setup, world)
    why, step = None, 0
    for step in range(1, math.ceil(setup.duration / dt - 1e-9) + 1):
        _advance(p, world, setup, run, (step - 1) * dt, dt)
        if step % CHECK_EVERY == 0:
            why = _trouble(p, setup, run, step * dt, dt)
        _take_snapshots(p, setup, run, step * dt)
        if run.sampling is not None and why is None:
            _keep_state(p, run)
            look(run.sampling, step * dt, run.positions.copy(), lambda: spheres_there(setup, run))
        if why is not None or _ends_early(setup, run, step * dt):
            break
    why = why or _trouble(p, setup, run, step * dt, dt)
    p.disconnect(world.client)
    return _movement(setup, run, why, step, dt)


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


def given_speed(setup: Setup) -> float:
    """Largest speed [m/s] that the setup gives a wall, or a grain at the start."""
    velocities, _ = start(setup)
    of_walls = (top_speed(wall.motion, wall.vertices) for wall in setup.walls)
    return max([float(np.max(np.linalg.norm(velocities, axis=1))), *of_walls])


def _start(setup: Setup, world: World) -> _Run:
    n = setup.packing.positions.shape[0]
    run = _Run(
        live=list(range(n)),
        bodies=list(world.grains),
        heights=setup.packing.positions[:, 2].copy(),
        exit_times=np.full(n, np.nan),
        positions=setup.packing.positions.copy(),
        orientations=setup.packing.orientations.copy(),
        velocities=np.zeros((n, 3)),
        angular_velocities=np.zeros((n, 3)),
    )
    if setup.samples is not None:
        run.sampling = begin(setup.samples, run.positions, lambda: spheres_there(setup, run))
    return run


def spheres_there(setup: Setup, run: _Run) -> Array:
    """Centres and radii (m, 4) [m] of the spheres of the grains still there."""
    live, grain = run.live, setup.grain
    scales = sizes(setup.packing)[live][:, None, None]
    quaternions = run.orientations[live]
    lengths = np.linalg.norm(quaternions, axis=1, keepdims=True)
    turns = rotation_matrices(quaternions / lengths)
    arms = scales * np.einsum("nij,kj->nki", turns, grain.offsets)
    radii = scales * grain.radii[:, None]  # (n, k, 1)
    centres = run.positions[live][:, None] + arms
    return np.concatenate([centres, radii], axis=2).reshape(-1, 4)


def _advance(p: Any, world: World, setup: Setup, run: _Run, time: float, dt: float) -> None:
    """One step from `time` to `time + dt`; grains that fell below `exit_z` leave."""
    # Contacts are found where a wall is now and solved for where it will be.
    place_walls(p, world, time, dt)
    p.stepSimulation()
    run.sphere_steps += float(len(run.live) * setup.grain.radii.size)
    before, run.heights = run.heights, read_heights(p, run.bodies)
    below = np.flatnonzero(run.heights < setup.exit_z)
    if below.size == 0:
        return
    _keep_state(p, run)
    # Within the step the fall is a straight line: the error is below g dt^2 / 8 = 1.3 um.
    part = (before[below] - setup.exit_z) / (before[below] - run.heights[below])
    run.exit_times[np.array(run.live)[below]] = time + dt * np.clip(part, 0.0, 1.0)
    for i in reversed(below.tolist()):
        p.removeBody(run.bodies.pop(i))
        run.live.pop(i)
    run.heights = np.delete(run.heights, below)


def _keep_state(p: Any, run: _Run) -> None:
    run.positions[run.live], run.orientations[run.live] = read_poses(p, run.bodies)
    velocities, spins = read_velocities(p, run.bodies)
    run.velocities[run.live], run.angular_velocities[run.live] = velocities, spins


def _trouble(p: Any, setup: Setup, run: _Run, time: float, dt: float) -> str | None:
    """Why the run is not to be believed, or None. Also keeps energy, overlap and rest."""
    _keep_state(p, run)
    if not np.all(np.isfinite(run.positions)):
        return f"the position of a grain is not a number at {time:.4f} s; shorten timestep"
    live = run.live
    energy = kinetic_energy(
        setup, live, run.velocities[live], run.angular_velocities[live], run.orientations[live]
    )
    r_min = smallest_radius(setup)
    overlaps, pairs = read_overlaps(p)
    deep = np.unique(pairs[overlaps > OVERLAP_LIMIT * r_min])
    run.max_kinetic_energy = max(run.max_kinetic_energy, energy)
    run.max_overlap = max(run.max_overlap, float(np.max(overlaps, initial=0.0)) / r_min)
    mass = setup.grain.mass * float(np.sum(sizes(setup.packing)[live] ** 3))
    if energy > 0.5 * mass * rest_speed(setup, dt) ** 2:
        run.restless_at = time
    limit = ENERGY_MARGIN * available_energy(setup, run.positions)
    if energy > limit:
        return (
            f"kinetic energy {energy:.3g} J at {time:.4f} s exceeds {ENERGY_MARGIN:g} times "
            f"what gravity and walls gave, {limit:.3g} J; shorten timestep"
        )
    deep_grains, grains = int(np.isin(run.bodies, deep).sum()), run.exit_times.size
    if deep_grains > max(DEEP_SHARE * grains, DEEP_FEW):
        return (
            f"{deep_grains} of {grains} grains overlap by more than {OVERLAP_LIMIT:g} "
            f"smallest radii at {time:.4f} s; shorten timestep or raise iterations"
        )
    return None


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


def _ends_early(setup: Setup, run: _Run, time: float) -> bool:
    if not run.live:
        return True
    if setup.settle and time - run.restless_at >= REST_TIME:
        return True
    return time >= setup.idle_after and not np.any(run.heights < setup.idle_above_z)


def _take_snapshots(p: Any, setup: Setup, run: _Run, time: float) -> None:
    """Keep the state for every snapshot that is due; grains that have left are nan."""
    due = np.sort(setup.snapshot_times)[len(run.snapshots) :]
    if due.size == 0 or due[0] > time:
        return
    _keep_state(p, run)
    gone = np.ones(run.exit_times.size, dtype=bool)
    gone[run.live] = False
    speeds = np.linalg.norm(run.velocities, axis=1)
    state = (
        time,
        np.where(gone[:, None], np.nan, run.positions),
        np.where(gone[:, None], np.nan, run.orientations),
        np.where(gone, np.nan, speeds),
    )
    run.snapshots.extend(state for _ in due[due <= time])


def _movement(setup: Setup, run: _Run, why: str | None, steps: int, dt: float) -> Movement:
    kept = zip(*run.snapshots, strict=True) if run.snapshots else ()
    sampled: Mapping[str, Array] = {}
    if run.sampling is not None:
        masses = setup.grain.mass * sizes(setup.packing) ** 3
        there = partial(spheres_there, setup, run)
        sampled = series(run.sampling, masses, there, finished=why is None)
    return Movement(
        status="finished" if why is None else "crashed",
        why=why,
        exit_times=run.exit_times,
        positions=run.positions,
        orientations=run.orientations,
        velocities=run.velocities,
        angular_velocities=run.angular_velocities,
        end_time=steps * dt,
        steps=steps,
        sphere_steps=run.sphere_steps,
        timestep=dt,
        max_overlap=run.max_overlap,
        max_kinetic_energy=run.max_kinetic_energy,
        cpu_s=0.0,
        snapshots=dict(zip(SNAPSHOT_KEYS, (np.array(a) for a in kept), strict=False)),
        series=sampled,
    )


def main(directory: Path) -> None:
    """Read the setup in `directory`, move the grains, write the movement there."""
    setup, engine = read_setup(directory)
    movement = move(setup, timestep=engine["timestep"], iterations=engine["iterations"])
    write_movement(movement, directory)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
