"""The run directory: everything a run needs to be resumed, reported and trusted.

    study.toml       the study as given
    run.json         format, versions, seeds, choices made at the start
    journal.jsonl    one line per generation, evaluation and insight, with its numbers, and one
                     on the engine of the reference runs
    outcomes/N.h5    arrays of evaluation N, if it has any

Arrays are written aside, flushed and renamed before the journal line is appended and
flushed, so a kill at any instant loses at most the runs in flight. A torn last line is
dropped. Nothing is ever unpickled.
"""

import contextlib
import io
import json
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from mfopt.arrays import AnyArray, frozen
from mfopt.errors import ConfigError
from mfopt.evaluation import Candidate, Evaluation, Generation, Insight, Reference
from mfopt.files import ASIDE, disk_errors_named, write_aside
from mfopt.lock import held
from mfopt.outcome import Outcome

FORMAT = 1


@dataclass(slots=True)
class RunDirectory:
    """A run directory, open for reading and appending."""

    path: Path
    header: Mapping[str, Any]
    generations: list[Generation] = field(default_factory=list)
    insights: list[Insight] = field(default_factory=list)
    reference: Reference | None = None  # None if the study asks for none
    end: str | None = None  # why the run ended; None while it runs or if it broke off
    _lines: list[dict[str, Any]] = field(default_factory=list)

    @property
    def study_file(self) -> Path:
        """The study as it was given."""
        return self.path / "study.toml"

    def __len__(self) -> int:
        return len(self._lines)

    def evaluations(self) -> Iterator[Evaluation]:
        """All evaluations in the order they were asked for, raw arrays included."""
        for line in sorted(self._lines, key=lambda line: int(line["index"])):
            yield self._evaluation(line)

    def evaluation(self, index: int) -> Evaluation | None:
        """The evaluation of that index, or None if it has not been made."""
        for line in self._lines:
            if line["index"] == index:
                return self._evaluation(line)
        return None

    def _evaluation(self, line: Mapping[str, Any]) -> Evaluation:
        x = frozen(line["x"])
        raw = {name: np.asarray(value) for name, value in line["raw"].items()}
        if line["arrays"]:
            raw |= read_arrays(self.path / "outcomes" / f"{line['index']}.h5")
        return Evaluation(
            Candidate(line["index"], x, line["level"], line["seed"], line["generation"],
                      line["purpose"]),
            Outcome(x, line["level"], line["seed"], line["status"], line["why"], raw,
                    line["work"], line["cpu_s"]),
            math.inf if line["objective"] is None else line["objective"],
        )  # fmt: skip

    def add_generation(self, generation: Generation) -> None:
        """Append a generation, unless the journal has it already."""
        if any(g.number == generation.number for g in self.generations):
            return
        self._append({"kind": "generation", **asdict(generation)})
        self.generations.append(generation)

    def add_insight(self, insight: Insight) -> None:
        """Append what a generation taught, unless the journal has it already."""
        if any(i.generation == insight.generation for i in self.insights):
            return
        self._append({"kind": "insight", **asdict(insight)})
        self.insights.append(insight)

    def add_evaluation(self, evaluation: Evaluation) -> None:
        """Append an evaluation: arrays first, then the journal line that makes it count."""
        c, o = evaluation.candidate, evaluation.outcome
        scalars = {name: a.item() for name, a in o.raw.items() if _fits_json(a)}
        arrays = {name: a for name, a in o.raw.items() if name not in scalars}
        line = {
            "kind": "evaluation", "index": c.index, "generation": c.generation,
            "purpose": c.purpose, "level": c.level, "seed": c.seed, "x": list(map(float, c.x)),
            "objective": evaluation.objective if math.isfinite(evaluation.objective) else None,
            "status": o.status, "why": o.why, "work": o.work, "cpu_s": o.cpu_s,
            "raw": scalars, "arrays": bool(arrays),
        }  # fmt: skip
        if arrays:
            write_arrays(self.path / "outcomes" / f"{c.index}.h5", arrays)
        self._append(line)
        self._lines.append(line)

    def add_reference(self, reference: Reference) -> None:
        """Say on which engine the reference runs are made; the last word counts."""
        self._append({"kind": "reference", **asdict(reference)})
        self.reference = reference

    def add_end(self, why: str) -> None:
        """Say that the run has ended, and why."""
        self._append({"kind": "end", "why": why})
        self.end = why

    def _append(self, line: Mapping[str, Any]) -> None:
        its = self.path / "journal.jsonl"
        with disk_errors_named(its, "write"), open(its, "ab") as journal:
            journal.write((json.dumps(line, allow_nan=False) + "\n").encode())
            journal.flush()
            os.fsync(journal.fileno())


def create(path: Path, study: str, header: Mapping[str, Any]) -> RunDirectory:
    """Start a run directory at `path` for the study text `study`.

    Raises:
        ConfigError: if there is a run already, or the directory cannot be written.
    """
    if (path / "run.json").exists():
        raise ConfigError(f"{path} holds a run already; use --resume, or another directory")
    header = {"format": FORMAT, **header}
    with disk_errors_named(path, "write"):
        (path / "outcomes").mkdir(parents=True, exist_ok=True)
    write_aside(path / "study.toml", study.encode())
    write_aside(path / "run.json", json.dumps(header, indent=2).encode())
    return RunDirectory(path, header)


def open_run(path: Path) -> RunDirectory:
    """Open a finished, running or broken-off run directory.

    Raises:
        ConfigError: if there is no run, or it is of another format.
    """
    try:
        header = json.loads((path / "run.json").read_text())
    except FileNotFoundError as error:
        raise ConfigError(f"{path} is not a run directory: it has no run.json") from error
    except (OSError, ValueError) as error:
        raise ConfigError(f"cannot read {path / 'run.json'}: {error}") from error
    if header.get("format") != FORMAT:
        raise ConfigError(
            f"{path} was written in format {header.get('format')!r}, this version reads {FORMAT}; "
            "use the version of mfopt that wrote it, or start a new run directory"
        )
    run = RunDirectory(path, header)
    for line in _journal(path / "journal.jsonl"):
        match line.pop("kind"):
            case "generation":
                run.generations.append(Generation(**line))
            case "insight":
                run.insights.append(Insight(**line | {"best": tuple(line["best"])}))
            case "evaluation":
                run._lines.append(line)
            case "reference":
                run.reference = Reference(**line)
            case "end":
                run.end = line["why"]
    return run


@contextlib.contextmanager
def writing(path: Path) -> Iterator[None]:
    """Hold the run directory for writing, and clear what a killed writer left there.

    That is a torn last line of the journal, and files that were not written to their end.

    Raises:
        ConfigError: if another mfopt is writing to it, or the disk refuses it.
    """
    with held(path):
        with disk_errors_named(path, "write"):
            _clear_leftovers(path)
            _drop_torn_line(path / "journal.jsonl")
        yield


def _clear_leftovers(path: Path) -> None:
    for file in (*path.glob(".*"), *(path / "outcomes").glob(".*")):
        parts = ASIDE.fullmatch(file.name)
        if parts is None:
            continue
        pid = int(parts["pid"])
        of_report = file.name.startswith(".report.")  # `mfopt report` needs no lock
        if not (of_report and pid != os.getpid() and Path(f"/proc/{pid}").exists()):
            file.unlink(missing_ok=True)


def _drop_torn_line(journal: Path) -> None:
    if journal.exists():
        text = journal.read_bytes()
        whole = text.rfind(b"\n") + 1
        if whole != len(text):
            os.truncate(journal, whole)


def _journal(path: Path) -> Iterator[dict[str, Any]]:
    if not path.exists():
        return
    for number, line in enumerate(path.read_bytes().split(b"\n")[:-1], start=1):
        try:
            yield json.loads(line)
        except ValueError as error:
            raise ConfigError(
                f"{path}, line {number} is damaged; restore the file, or delete that line "
                "and what follows and resume"
            ) from error


def write_arrays(path: Path, arrays: Mapping[str, AnyArray]) -> None:
    """Write named arrays to an HDF5 file that is either whole or absent."""
    content = io.BytesIO()  # HDF5 cannot close a file on a full disk
    with h5py.File(content, "w") as file:
        for name, values in arrays.items():
            array = np.asarray(values)
            packed = {"compression": "gzip"} if array.size > 1000 else {}
            file.create_dataset(name, data=array, **packed)
    write_aside(path, content.getvalue())


def read_arrays(path: Path) -> dict[str, AnyArray]:
    """Read every array of an HDF5 file.

    Raises:
        ConfigError: if the file is missing or damaged.
    """
    try:
        with h5py.File(path, "r") as file:
            return {name: np.asarray(dataset) for name, dataset in file.items()}
    except OSError as error:
        raise ConfigError(f"{path} is missing or damaged; restore it: {error}") from error


def _fits_json(value: AnyArray) -> bool:
    """Whether JSON gives this number back bit for bit, and with its type."""
    return value.ndim == 0 and value.dtype in (np.int64, np.float64) and bool(np.isfinite(value))
