"""Files through which an engine in another process is given its setup and hands back its result.

`setup.npz` and `setup.json` hold the setup, `result.npz` and `result.json` the movement:
arrays in the first, numbers and words in the second. Plain numpy and json read and write
them, so that a script in a foreign Python needs nothing of this project.

setup.npz: `grain_offsets`, `grain_radii`, `grain_inertia`, `positions`, `orientations`,
`snapshot_times`; where given `scales`, `velocities`, `angular_velocities`; for wall number i
`wall_vertices_<i>`, `wall_triangles_<i>`, if it moves `wall_times_<i>` and
`wall_displacements_<i>`, and if it turns `wall_angles_<i>`; where samples are asked for
`sample_times`, and with columns `column_edges` and `column_floors`.
setup.json: `grain_mass`; `grain_material` and `physics` as mappings; `walls`, a list of
`{"name", "material", "motion", "friction_angle", "until"}`, the material a mapping, the motion null
or the mapping `{"axis", "pivot"}`, `until` null for a wall that stays; `duration`, `exit_z`,
`settle`, `idle_after`, `idle_above_z`, `may_pinch`; `sample_planes`, a list of `{"z", "opening"}`;
and `engine`, what the engine adds for its script.
result.npz: `exit_times`, `positions`, `orientations`, `velocities`, `angular_velocities`, and
where snapshots or samples were asked for the arrays of `Movement.snapshots` and `.series`.
result.json: `status`, `why`, `end_time`, `steps`, `sphere_steps`, `timestep`, `max_overlap`,
`max_kinetic_energy`, and `energy` where the engine keeps a balance.
"""

import json
import math
import zipfile
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from fidelity.engine import (
    BodyForce,
    Grain,
    Material,
    Movement,
    Packing,
    Physics,
    Setup,
    Wall,
    WallMotion,
)
from fidelity.samples import Columns, Plane, Samples
from mfopt.arrays import AnyArray
from mfopt.records.outcome import Status

SNAPSHOT_KEYS = (
    "snapshot_times",
    "snapshot_positions",
    "snapshot_orientations",
    "snapshot_speeds",
    "snapshot_wall_forces",
)
SERIES_KEYS = ("sample_times", "passed", "passage_times", "levels")


def write_setup(setup: Setup, directory: Path, engine: Mapping[str, Any] | None = None) -> None:
    """Write `setup`, and what the engine's script needs besides, into `directory`."""
    arrays = {
        "grain_offsets": setup.grain.offsets,
        "grain_radii": setup.grain.radii,
        "grain_inertia": setup.grain.inertia,
        "positions": setup.packing.positions,
        "orientations": setup.packing.orientations,
        "scales": setup.packing.scales,
        "velocities": setup.velocities,
        "angular_velocities": setup.angular_velocities,
        "snapshot_times": setup.snapshot_times,
    }
    for i, wall in enumerate(setup.walls):
        arrays |= _wall_arrays(i, wall)
    arrays |= _sample_arrays(setup.samples)
    scalars = {
        "grain_mass": setup.grain.mass,
        "grain_material": asdict(setup.grain_material),
        "physics": asdict(setup.physics),
        "walls": [_wall_scalars(wall) for wall in setup.walls],
        "duration": setup.duration,
        "exit_z": setup.exit_z,
        "settle": setup.settle,
        "idle_after": setup.idle_after,
        "idle_above_z": setup.idle_above_z,
        "may_pinch": setup.may_pinch,
        "sample_planes": [asdict(p) for p in setup.samples.planes] if setup.samples else [],
        "engine": dict(engine or {}),
    }
    given = {name: values for name, values in arrays.items() if values is not None}
    np.savez(directory / "setup.npz", **given)  # type: ignore[arg-type]
    (directory / "setup.json").write_text(json.dumps(scalars), encoding="utf-8")


def _wall_arrays(i: int, wall: Wall) -> dict[str, AnyArray | None]:
    arrays: dict[str, AnyArray | None] = {
        f"wall_vertices_{i}": wall.vertices,
        f"wall_triangles_{i}": wall.triangles,
    }
    if wall.motion is not None:
        arrays[f"wall_times_{i}"] = wall.motion.times
        arrays[f"wall_displacements_{i}"] = wall.motion.displacements
        arrays[f"wall_angles_{i}"] = wall.motion.angles
    return arrays


def _sample_arrays(samples: Samples | None) -> dict[str, AnyArray | None]:
    if samples is None:
        return {}
    columns = samples.columns
    return {
        "sample_times": samples.times,
        "column_edges": None if columns is None else columns.edges,
        "column_floors": None if columns is None else columns.floors,
    }


def _wall_scalars(wall: Wall) -> dict[str, Any]:
    motion = wall.motion
    return {
        "name": wall.name,
        "material": asdict(wall.material),
        "motion": None if motion is None else {"axis": motion.axis, "pivot": motion.pivot},
        "friction_angle": wall.friction_angle,
        "until": wall.until if math.isfinite(wall.until) else None,
    }


def read_setup(directory: Path) -> tuple[Setup, dict[str, Any]]:
    """Read back what `write_setup` wrote: the setup, and what the engine added."""
    scalars = json.loads((directory / "setup.json").read_text(encoding="utf-8"))
    with np.load(directory / "setup.npz", allow_pickle=False) as stored:
        arrays = {name: np.asarray(stored[name]) for name in stored.files}
    setup = Setup(
        grain=Grain(
            offsets=arrays["grain_offsets"],
            radii=arrays["grain_radii"],
            mass=scalars["grain_mass"],
            inertia=arrays["grain_inertia"],
        ),
        packing=Packing(arrays["positions"], arrays["orientations"], arrays.get("scales")),
        grain_material=Material(**scalars["grain_material"]),
        walls=tuple(_read_wall(i, wall, arrays) for i, wall in enumerate(scalars["walls"])),
        physics=_read_physics(scalars["physics"]),
        duration=scalars["duration"],
        exit_z=scalars["exit_z"],
        velocities=arrays.get("velocities"),
        angular_velocities=arrays.get("angular_velocities"),
        settle=scalars["settle"],
        idle_after=scalars["idle_after"],
        idle_above_z=scalars["idle_above_z"],
        snapshot_times=arrays["snapshot_times"],
        may_pinch=scalars["may_pinch"],
        samples=read_samples({**scalars, **arrays}),
    )
    return setup, scalars["engine"]


def _read_wall(i: int, wall: Mapping[str, Any], arrays: Mapping[str, AnyArray]) -> Wall:
    return Wall(
        name=wall["name"],
        vertices=arrays[f"wall_vertices_{i}"],
        triangles=arrays[f"wall_triangles_{i}"],
        material=Material(**wall["material"]),
        motion=read_motion(i, wall, arrays),
        friction_angle=wall["friction_angle"],
        until=math.inf if wall["until"] is None else wall["until"],
    )


def read_motion(
    i: int, wall: Mapping[str, Any], arrays: Mapping[str, AnyArray]
) -> WallMotion | None:
    """The motion of wall number `i`, from its mapping in setup.json and the arrays of setup.npz."""
    given = wall["motion"]
    if given is None:
        return None
    return WallMotion(
        times=arrays[f"wall_times_{i}"],
        displacements=arrays[f"wall_displacements_{i}"],
        angles=arrays.get(f"wall_angles_{i}"),
        axis=tuple(given["axis"]),
        pivot=tuple(given["pivot"]),
    )


def read_samples(given: Mapping[str, Any]) -> Samples | None:
    """The samples asked for, from the values of setup.json and the arrays of setup.npz."""
    if "sample_times" not in given:
        return None
    planes = [
        Plane(plane["z"], plane["opening"] and tuple(plane["opening"]))
        for plane in given["sample_planes"]
    ]
    with_columns = "column_edges" in given
    columns = Columns(given["column_edges"], given["column_floors"]) if with_columns else None
    return Samples(given["sample_times"], tuple(planes), columns)


def _read_physics(given: Mapping[str, Any]) -> Physics:
    forces = [{name: tuple(v) for name, v in force.items()} for force in given["body_forces"]]
    return Physics(
        **{
            **given,
            "gravity_direction": tuple(given["gravity_direction"]),
            "body_forces": tuple(BodyForce(**force) for force in forces),
        }
    )


def write_movement(movement: Movement, directory: Path) -> None:
    """Write `movement` into `directory`; its CPU time is measured by the parent."""
    arrays = {
        "exit_times": movement.exit_times,
        "positions": movement.positions,
        "orientations": movement.orientations,
        "velocities": movement.velocities,
        "angular_velocities": movement.angular_velocities,
        **movement.snapshots,
        **movement.series,
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
        "energy": dict(movement.energy),
    }
    np.savez(directory / "result.npz", **arrays)  # type: ignore[arg-type]
    (directory / "result.json").write_text(json.dumps(scalars), encoding="utf-8")


def read_movement(directory: Path, *, cpu_s: float) -> Movement | None:
    """Read the result that the script left in `directory`; None if it left none that is whole."""
    if not all((directory / name).is_file() for name in ("result.json", "result.npz")):
        return None  # neither waits for a named pipe that a script put in their place
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
            angular_velocities=arrays["angular_velocities"],
            snapshots={key: arrays[key] for key in SNAPSHOT_KEYS if key in arrays},
            series={key: arrays[key] for key in SERIES_KEYS if key in arrays},
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
        angular_velocities=np.zeros((n, 3)),
        end_time=0.0,
        steps=0,
        sphere_steps=0.0,
        timestep=0.0,
        max_overlap=0.0,
        max_kinetic_energy=0.0,
        cpu_s=cpu_s,
    )
