"""Files through which an engine in another process is given its setup and hands back its movement.

`setup.json` and `result.json` hold records by the names of their fields. An array is named there by
its number in `setup.npz` or `result.npz`. This file needs only numpy, so that a script in YADE's
own Python reads and writes them too.
"""

import json
import zipfile
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
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

RECORDS: Mapping[str, type[Any]] = {
    kind.__name__: kind
    for kind in (
        BodyForce, Columns, Grain, Material, Movement, Packing, Physics, Plane, Samples, Setup,
        Wall, WallMotion,
    )
}  # fmt: skip


def write_setup(setup: Setup, directory: Path, engine: Mapping[str, Any] | None = None) -> None:
    """Write `setup`, and what the engine's script needs besides, into `directory`."""
    _write(directory, "setup", {"setup": setup, "engine": engine or {}})


def read_setup(directory: Path) -> tuple[Setup, dict[str, Any]]:
    """Read back what `write_setup` wrote: the setup, and what the engine added."""
    given = _read(directory, "setup")
    return given["setup"], given["engine"]


def write_movement(movement: Movement, directory: Path) -> None:
    """Write `movement` into `directory`; its CPU time is measured by the parent."""
    _write(directory, "result", movement)


def read_movement(directory: Path, *, cpu_s: float) -> Movement | None:
    """Read the result that the script left in `directory`; None if it left none that is whole."""
    if not all((directory / name).is_file() for name in ("result.json", "result.npz")):
        return None  # neither waits for a named pipe that a script put in their place
    try:
        found = _read(directory, "result")
    except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile):
        return None  # the script died before or while it wrote
    return replace(found, cpu_s=cpu_s) if isinstance(found, Movement) else None


def _write(directory: Path, name: str, content: Any) -> None:
    arrays: list[AnyArray] = []
    text = json.dumps(_packed(content, arrays))
    np.savez(directory / f"{name}.npz", *arrays)
    (directory / f"{name}.json").write_text(text, encoding="utf-8")


def _packed(value: Any, arrays: list[AnyArray]) -> Any:
    """The value as JSON can hold it; its arrays are added to `arrays`."""
    if isinstance(value, np.ndarray):
        arrays.append(value)
        return {"array": f"arr_{len(arrays) - 1}"}  # as np.savez calls it
    if is_dataclass(value):
        own = {field.name: getattr(value, field.name) for field in fields(value)}
        return {"record": type(value).__name__, **_packed(own, arrays)}
    if isinstance(value, Mapping):
        return {"fields": {name: _packed(part, arrays) for name, part in value.items()}}
    if isinstance(value, tuple):
        return [_packed(part, arrays) for part in value]
    return value


def _read(directory: Path, name: str) -> Any:
    packed = json.loads((directory / f"{name}.json").read_text(encoding="utf-8"))
    # Opened here: given a path, np.load leaves a torn file open.
    with (
        (directory / f"{name}.npz").open("rb") as file,
        np.load(file, allow_pickle=False) as arrays,
    ):
        return _unpacked(packed, arrays)


def _unpacked(value: Any, arrays: Mapping[str, AnyArray]) -> Any:
    if isinstance(value, list):
        return tuple(_unpacked(part, arrays) for part in value)
    if not isinstance(value, dict):
        return value
    if "array" in value:
        return np.asarray(arrays[value["array"]])
    own = {name: _unpacked(part, arrays) for name, part in value["fields"].items()}
    return RECORDS[value["record"]](**own) if "record" in value else own
