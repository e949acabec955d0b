"""Runs of the agreement campaign: a record, one small JSON file each.

A file says by its content, not its name, what it holds: `engine`, `grains`, `seed`, `status`,
`why`, `raw` (arrays by name, SI units), `work`, `cpu_s`; `scene` (dosing where it is absent),
for dosing the name of the `design`, and `settings` where a scene has some.
"""

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from mfopt.arrays import AnyArray
from mfopt.errors import ConfigError
from mfopt.outcome import Status

DIGITS = 9  # significant digits kept: finer than any engine, a third of the size


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """One scene run once on one engine, finished or failed."""

    engine: str  # as it is called on the command line
    scene: str  # `discharge`, `heap`, `silo`, or `dosing:` and the name of a design
    grains: int
    seed: int
    status: Status
    why: str | None
    raw: Mapping[str, AnyArray]
    work: float  # [sphere-steps times the engine's cost factor], filling and run
    cpu_s: float  # of filling and run
    settings: Mapping[str, Any] = field(default_factory=dict)  # that geometry and numerics follow

    @property
    def finished(self) -> bool:
        """Whether there are results."""
        return self.status == "finished"


def run_path(directory: Path, engine: str, scene: str, grains: int, seed: int) -> Path:
    """File of a run."""
    return directory / f"{engine}-{scene.replace(':', '-')}-{grains}-{seed}.json"


def write_run(path: Path, run: Run) -> None:
    """Write the run aside and rename it, so that a file that is there is whole."""
    scene, _, design = run.scene.partition(":")
    content = {
        "engine": run.engine,
        "scene": scene,
        **({"design": design} if design else {}),
        "grains": run.grains,
        "seed": run.seed,
        "status": run.status,
        "why": run.why,
        "raw": {name: _short(values) for name, values in run.raw.items()},
        "work": run.work,
        "cpu_s": run.cpu_s,
        "settings": dict(run.settings),
    }
    aside = path.with_suffix(".tmp")
    aside.write_text(json.dumps(content), encoding="utf-8")
    os.replace(aside, path)


def _short(values: AnyArray) -> Any:
    text = np.vectorize(lambda v: float(f"{v:.{DIGITS}g}"), otypes=[float])
    return text(values).tolist() if np.size(values) else []


def read_run(path: Path) -> Run:
    """Read a run back.

    Raises:
        ConfigError: if the file is no run.
    """
    try:
        given = json.loads(path.read_text(encoding="utf-8"))
        design = given.get("design")
        scene = given.get("scene", "dosing")
        return Run(
            engine=given["engine"],
            scene=scene if design is None else f"{scene}:{design}",
            grains=int(given["grains"]),
            seed=int(given["seed"]),
            status=given["status"],
            why=given["why"],
            raw={name: np.asarray(values, float) for name, values in given["raw"].items()},
            work=float(given["work"]),
            cpu_s=float(given["cpu_s"]),
            settings=given.get("settings", {}),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise ConfigError(f"{path} is no run of the campaign ({error!r}); remove it") from error


def read_runs(directories: Iterable[Path]) -> list[Run]:
    """Read all runs in some directories, in the order of their names.

    Raises:
        ConfigError: if there is none, or one was run with other settings than its peers.
    """
    runs = [read_run(path) for folder in directories for path in sorted(folder.glob("*.json"))]
    if not runs:
        raise ConfigError("there are no runs in the given directories; run the campaign first")
    first: dict[tuple[str, int], Mapping[str, Any]] = {}
    for run in runs:
        if first.setdefault((run.scene, run.grains), run.settings) != run.settings:
            raise ConfigError(
                f"{run.scene} with {run.grains} grains, seed {run.seed} on {run.engine}: settings "
                "differ from those of other runs of that scene; remove the older runs"
            )
    return runs
