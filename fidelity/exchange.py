"""Files through which an engine in another process is given its setup and hands back its result.

`setup.npz` and `setup.json` hold the setup, `result.npz` and `result.json` the movement:
arrays in the first, numbers and words in the second. Plain numpy and json read and write
them, so that a script in a foreign Python needs nothing of this project.

setup.npz: `grain_offsets`, `grain_radii`, `grain_inertia`, `positions`, `orientations`,
`motion_times`, `motion_displacements` (both empty without motion), `snapshot_times`, and
`wall_vertices_<i>`, `wall_triangles_<i>` for wall number i.
setup.json: `grain_mass`; `grain_material`, `wall_material` and `physics` as mappings;
`walls`, a list of `{"name", "moves"}`; `start_velocity`, `duration`, `exit_z`, `settle`,
`idle_after`, `idle_above_z`; and `engine`, what the engine adds for its script.
result.npz: `exit_times`, `positions`, `orientations`, `velocities`, and where snapshots were
asked for the arrays of `Movement.snapshots`.
result.json: `status`, `why`, `end_time`, `steps`, `sphere_steps`, `timestep`, `max_overlap`,
`max_kinetic_energy`.
"""

import json
import zipfile
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from fidelity.engine import Grain, Material, Movement, Packing, Physics, Setup, Wall, WallMotion
from mfopt.outcome import Status

SNAPSHOT_KEYS = (
    "snapshot_times",
    "snapshot_positions",
    "snapshot_orientations",
    "snapshot_speeds",
)


def write_setup(setup: Setup, directory: Path, engine: Mapping[str, Any] | None = None) -> None:
    """Write `setup`, and what the engine's script needs besides, into `directory`."""
    motion = setup.motion
    arrays = {
        "grain_offsets": setup.grain.offsets,
        "grain_radii": setup.grain.radii,
        "grain_inertia": setup.grain.inertia,
        "positions": setup.packing.positions,
        "orientations": setup.packing.orientations,
        "motion_times": np.empty(0) if motion is None else motion.times,
        "motion_displacements": np.empty(0) if motion is None else motion.displacements,
        "snapshot_times": setup.snapshot_times,
    }
    for i, wall in enumerate(setup.walls):
        arrays[f"wall_vertices_{i}"] = wall.vertices
        arrays[f"wall_triangles_{i}"] = wall.triangles.astype(np.float64)
    scalars = {
        "grain_mass": setup.grain.mass,
        "grain_material": asdict(setup.grain_material),
        "wall_material": asdict(setup.wall_material),
        "physics": asdict(setup.physics),
        "walls": [{"name": wall.name, "moves": wall.moves} for wall in setup.walls],
        "start_velocity": setup.start_velocity,
        "duration": setup.duration,
        "exit_z": setup.exit_z,
        "settle": setup.settle,
        "idle_after": setup.idle_after,
        "idle_above_z": setup.idle_above_z,
        "engine": dict(engine or {}),
    }
    np.savez(directory / "setup.npz", **arrays)  # type: ignore[arg-type]
    (directory / "setup.json").write_text(json.dumps(scalars), encoding="utf-8")


def read_setup(directory: Path) -> tuple[Setup, dict[str, Any]]:
    """Read back what `write_setup` wrote: the setup, and what the engine added."""
    scalars = json.loads((directory / "setup.json").read_text(encoding="utf-8"))
    with np.load(directory / "setup.npz", allow_pickle=False) as arrays:
        walls = tuple(
            Wall(
                name=wall["name"],
                vertices=arrays[f"wall_vertices_{i}"],
                triangles=arrays[f"wall_triangles_{i}"].astype(np.int64),
                moves=wall["moves"],
            )
            for i, wall in enumerate(scalars["walls"])
        )
        times = arrays["motion_times"]
        setup = Setup(
            grain=Grain(
                offsets=arrays["grain_offsets"],
                radii=arrays["grain_radii"],
                mass=scalars["grain_mass"],
                inertia=arrays["grain_inertia"],
            ),
            packing=Packing(arrays["positions"], arrays["orientations"]),
            grain_material=Material(**scalars["grain_material"]),
            wall_material=Material(**scalars["wall_material"]),
            walls=walls,
            physics=Physics(**scalars["physics"]),
            start_velocity=scalars["start_velocity"],
            duration=scalars["duration"],
            exit_z=scalars["exit_z"],
            motion=WallMotion(times, arrays["motion_displacements"]) if times.size else None,
            settle=scalars["settle"],
            idle_after=scalars["idle_after"],
            idle_above_z=scalars["idle_above_z"],
            snapshot_times=arrays["snapshot_times"],
        )
    return setup, scalars["engine"]


def write_movement(movement: Movement, directory: Path) -> None:
    """Write `movement` into `directory`; its CPU time is measured by the parent."""
    arrays = {
        "exit_times": movement.exit_times,
        "positions": movement.positions,
        "orientations": movement.orientations,
        "velocities": movement.velocities,
        **movement.snapshots,
    }
    scalars = {
        "status": movement.status,
        "why": movement.why,
        "end_time": movement.end_time,
        "steps": movement.steps,
        "sphere_steps": movement.sphere_steps,
        "timestep": movement.timestep,
        "max_overlap": movement.max_overlap,
        "max_kinetic_energy": movement.max_kinetic_energy,
    }
    np.savez(directory / "result.npz", **arrays)  # type: ignore[arg-type]
    (directory / "result.json").write_text(json.dumps(scalars), encoding="utf-8")


def read_movement(directory: Path, *, cpu_s: float) -> Movement | None:
    """Read the result that the script left in `directory`; None if it left none that is whole."""
    try:
        scalars = json.loads((directory / "result.json").read_text(encoding="utf-8"))
        # Opened here: given a path, np.load leaves a torn file open.
        with (
            (directory / "result.npz").open("rb") as file,
            np.load(file, allow_pickle=False) as stored,
        ):
            arrays = {name: np.asarray(stored[name]) for name in stored.files}
        return Movement(
            exit_times=arrays["exit_times"],
            positions=arrays["positions"],
            orientations=arrays["orientations"],
            velocities=arrays["velocities"],
            snapshots={key: arrays[key] for key in SNAPSHOT_KEYS if key in arrays},
            cpu_s=cpu_s,
            **scalars,
        )
    except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile):
        return None  # the script died before or while it wrote


def failed_movement(setup: Setup, status: Status, why: str, *, cpu_s: float) -> Movement:
    """The movement of a run that ended without a result: the grains are where they began."""
    packing = setup.packing
    n = packing.positions.shape[0]
    return Movement(
        status=status,
        why=why,
        exit_times=np.full(n, np.nan),
        positions=packing.positions,
        orientations=packing.orientations,
        velocities=np.zeros((n, 3)),
        end_time=0.0,
        steps=0,
        sphere_steps=0.0,
        timestep=0.0,
        max_overlap=0.0,
        max_kinetic_energy=0.0,
        cpu_s=cpu_s,
    )
