"""Runs of the agreement campaign: records, one line of JSON each.

A file holds the runs of one scene of one size on one engine. A line says by itself what it holds:
`engine`, `scene`, `grains`, `seed`, `status`, `why`, `raw` (arrays by name, SI units), `work`,
`cpu_s` and `settings`. A line that was cut off is no run. Packed lines (`benchmarks.lines`) hold
times to 1e-5 s.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import lines
from mfopt.arrays import AnyArray
from mfopt.errors import ConfigError
from mfopt.records.outcome import Status

DIGITS = 6  # significant digits kept: finer than the time step of any engine


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


def add_run(directory: Path, run: Run) -> None:
    """Add the run to the file of its engine, scene and size."""
    content = {
        "engine": run.engine,
        "scene": run.scene,
        "grains": run.grains,
        "seed": run.seed,
        "status": run.status,
        "why": run.why,
        "raw": {name: _short(values) for name, values in run.raw.items()},
        "work": run.work,
        "cpu_s": run.cpu_s,
        "settings": dict(run.settings),
    }
    name = f"{run.engine}-{run.scene.replace(':', '-')}-{run.grains}"
    lines.append(directory / f"{name}.jsonl", content)


def _short(values: AnyArray) -> Any:
    text = np.vectorize(lambda v: float(f"{v:.{DIGITS}g}"), otypes=[float])
    return text(values).tolist() if np.size(values) else []


def runs_in(directory: Path) -> list[Run]:
    """All runs of a directory by file and seed; none where there is no directory yet.

    Raises:
        ConfigError: if a line is something else than a run.
    """
    runs = []
    for path in lines.files_in(directory):
        found = [_run(place, content) for place, content in lines.read(path)]
        runs += sorted(found, key=lambda run: run.seed)
    return runs


def _run(place: str, given: Any) -> Run:
    try:
        return Run(
            engine=given["engine"],
            scene=given["scene"],
            grains=int(given["grains"]),
            seed=int(given["seed"]),
            status=given["status"],
            why=given["why"],
            raw={name: np.asarray(values, float) for name, values in given["raw"].items()},
            work=float(given["work"]),
            cpu_s=float(given["cpu_s"]),
            settings=given["settings"],
        )
    except (KeyError, TypeError, ValueError) as error:
        raise ConfigError(f"{place} is no run of the campaign ({error!r}); remove it") from error


def read_runs(directories: Iterable[Path]) -> list[Run]:
    """Read all runs of some directories.

    Raises:
        ConfigError: if there is none, or one was run with other settings than its peers.
    """
    runs = [run for directory in directories for run in runs_in(directory)]
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
