"""The run directory: everything a run needs to be resumed, reported and trusted.

    study.toml       the study as given
    run.json         format, versions, seeds, choices made at the start, with a check
    journal.jsonl    one line per generation, evaluation and insight, with its numbers, each with
                     a check; one on the engine of the reference runs
    outcomes/N.h5    arrays of the N-th evaluation, if they are too large for its line
    lock             held while a run writes

Arrays are written aside, flushed and renamed before the journal line is appended and
flushed, so a kill at any instant loses at most the runs in flight. A torn last line is
dropped. Nothing is ever unpickled. What does not fit its check is named and never used.

A run may be extended, by a larger budget for instance. Its search is then replayed; evaluations
that it asks for again are used again, found by what they are of and not by their place.
"""

import contextlib
import json
import math
import os
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from mfopt.arrays import AnyArray, frozen
from mfopt.campaign.journal import Journal, Line
from mfopt.campaign.place import check_place
from mfopt.campaign.run_header import read_header, sealed
from mfopt.errors import ConfigError
from mfopt.files.array_file import as_text, digest, fit_hdf5, from_text, read_arrays, write_arrays
from mfopt.files.lock import held
from mfopt.files.whole import ASIDE, disk_errors_named, write_aside
from mfopt.records.evaluation import Candidate, Evaluation, Generation, Insight, Reference
from mfopt.records.objective import OWN, Criteria, value
from mfopt.records.outcome import Outcome

HELD = "holds a run already; use --resume, or another directory"
SAME_OBJECTIVE = 1e-9  # relative: another processor may add in another order
MOST_IN_LINE = 16_000  # [bytes] arrays of a run that its line holds; more are a file

Stored = dict[str, Any]  # line of an evaluation, without arrays that are in it
Of = tuple[str, str, int, bytes]  # purpose, level, seed and design of a candidate


class DamagedArrays(ConfigError):
    """The arrays of an evaluation are gone or changed; a resumed run makes it again."""


@dataclass(slots=True)
class RunDirectory:
    """A run directory, open for reading and appending."""

    path: Path
    header: Mapping[str, Any]
    criteria: Criteria = OWN  # how its runs are judged
    generations: list[Generation] = field(default_factory=list)
    insights: list[Insight] = field(default_factory=list)
    reference: Reference | None = None  # None if the study asks for none
    end: str | None = None  # why the run ended; None while it runs or if it broke off
    _journal: Journal = field(init=False)
    _stored: dict[int, Stored] = field(default_factory=dict)  # by index of the candidate
    _earlier: dict[int, Stored] = field(default_factory=dict)  # by number, before an extension
    _alike: dict[Of, list[int]] = field(default_factory=dict)  # numbers of those, by what of
    _made: int = 0  # evaluations, those before an extension included
    _noted: set[tuple[str, int]] = field(default_factory=set)  # generations and insights
    _objectives: dict[int, str] = field(default_factory=dict)  # that rank them, by generation

    def __post_init__(self) -> None:
        self._journal = Journal(self.path / "journal.jsonl", str(self.header.get("check")))

    @property
    def study_file(self) -> Path:
        """The study as it was given."""
        return self.path / "study.toml"

    def study(self) -> str:
        """Text of the study as it was given; empty for a run of `mfopt.minimize`.

        Raises:
            ConfigError: if the file is not the one that was given.
        """
        with disk_errors_named(self.study_file, "read"):
            content = self.study_file.read_bytes()
        if digest(content) != self.header.get("study_check"):
            raise ConfigError(
                f"{self.study_file} is not the study of this run; restore it, or resume the run "
                "with its study, which writes it anew"
            )
        return content.decode("utf-8")

    def __len__(self) -> int:
        return len(self._stored)

    @property
    def made(self) -> int:
        """Evaluations made, those included that an extended run does not use."""
        return self._made

    @property
    def kept(self) -> int:
        """Evaluations made before an extension, and not used again so far."""
        return len(self._earlier)

    @property
    def nothing_finished(self) -> bool:
        """Whether no run has finished, those before an extension included."""
        made = (*self._stored.values(), *self._earlier.values())
        return all(its["status"] != "finished" for its in made)

    @property
    def purposes(self) -> set[str]:
        """What the evaluations are for, those before an extension included."""
        return {its["purpose"] for its in (*self._stored.values(), *self._earlier.values())}

    def evaluations(self) -> Iterator[Evaluation]:
        """All evaluations in the order they were asked for, raw arrays included.

        Raises:
            ConfigError: if the arrays of one are damaged.
        """
        for index in sorted(self._stored):
            yield self._evaluation(self._stored[index])

    def evaluation(self, index: int) -> Evaluation | None:
        """The evaluation of that index, or None if it has not been made.

        Raises:
            DamagedArrays: if its arrays are gone or changed.
        """
        stored = self._stored.get(index)
        return None if stored is None else self._evaluation(stored)

    def _evaluation(self, stored: Stored) -> Evaluation:
        x = frozen(stored["x"])
        raw = {name: np.asarray(value) for name, value in stored["raw"].items()}
        outcome = Outcome(
            x, stored["level"], stored["seed"], stored["status"], stored["why"],
            raw | self._arrays(stored), stored["work"], stored["cpu_s"],
        )  # fmt: skip
        objective = math.inf if stored["objective"] is None else stored["objective"]
        self._check_objective(stored, outcome, objective)
        return Evaluation(_candidate(stored), outcome, objective)

    def _check_objective(self, stored: Stored, outcome: Outcome, objective: float) -> None:
        """Refuse an objective that is not what the outcome gives, as far as the criteria say."""
        name = self._objectives.get(stored["generation"], self.header.get("objective"))
        known = self.criteria.objectives.get(str(name))
        if known is None:
            return
        now = value(known, outcome)
        if not math.isclose(now, objective, rel_tol=SAME_OBJECTIVE):
            raise ConfigError(
                f"{self.path}: evaluation {stored['index']} is stored with the objective "
                f"{objective:.17g}, but its outcome gives {now:.17g}; it was made by another "
                "version, so use that, or start a new run directory"
            )

    def _arrays(self, stored: Stored) -> dict[str, AnyArray]:
        if (begins := stored.get("begins")) is not None:
            return {
                name: from_text(text)
                for name, text in self._journal.record_at(begins)["arrays"].items()
            }
        if stored["arrays"] is None:
            return {}
        try:
            return read_arrays(self._file(stored["number"]), stored["arrays"])
        except ConfigError as error:
            raise DamagedArrays(
                f"evaluation {stored['index']} cannot be used: {error}; `mfopt run --resume` makes "
                "it again"
            ) from error

    def _file(self, number: int) -> Path:
        return self.path / "outcomes" / f"{number}.h5"

    def add_generation(self, generation: Generation) -> None:
        """Append a generation, unless the journal has it already."""
        if ("generation", generation.number) not in self._noted:
            self._add({"kind": "generation", **asdict(generation)})

    def add_insight(self, insight: Insight) -> None:
        """Append what a generation taught, unless the journal has it already."""
        if ("insight", insight.generation) not in self._noted:
            self._add({"kind": "insight", **asdict(insight)})

    def add_evaluation(self, evaluation: Evaluation) -> None:
        """Append an evaluation: arrays first, then the journal line that makes it count."""
        c, o = evaluation.candidate, evaluation.outcome
        scalars = {name: a.item() for name, a in o.raw.items() if _fits_json(a)}
        arrays = {name: a for name, a in o.raw.items() if name not in scalars}
        self._add({
            "kind": "evaluation", "number": self._made, "index": c.index,
            "generation": c.generation, "purpose": c.purpose, "level": c.level, "seed": c.seed,
            "x": list(map(float, c.x)),
            "objective": evaluation.objective if math.isfinite(evaluation.objective) else None,
            "status": o.status, "why": o.why, "work": o.work, "cpu_s": o.cpu_s,
            "raw": scalars, "arrays": self._packed(arrays),
        })  # fmt: skip

    def _packed(self, arrays: Mapping[str, AnyArray]) -> dict[str, str] | str | None:
        """Arrays as their line holds them: themselves, the digest of their file, or nothing."""
        small = sum(array.nbytes for array in arrays.values()) <= MOST_IN_LINE
        if not arrays:
            return None
        if small or not all(map(fit_hdf5, arrays.values())):
            return {name: as_text(array) for name, array in arrays.items()}
        return write_arrays(self._file(self._made), arrays)

    def add_reference(self, reference: Reference) -> None:
        """Say on which engine the reference runs are made; the last word counts."""
        self._add({"kind": "reference", **asdict(reference)})

    def add_end(self, why: str) -> None:
        """Say that the run has ended, and why."""
        self._add({"kind": "end", "why": why})

    def forget(self, index: int) -> None:
        """Say that an evaluation is of no use, because its arrays are damaged."""
        self._add({"kind": "lost", "index": index})

    def extend(self, changed: Mapping[str, Any], study: str) -> None:
        """Let the run go on with other entries of its header; its search is to be replayed.

        Args:
            study: text of the study that says so, to be kept in place of the one before.
        """
        content = study.encode()
        self._add({"kind": "extended", "header": {**changed, "study_check": digest(content)}})
        write_aside(self.study_file, content)

    def use_again(self, candidate: Candidate) -> Evaluation | None:
        """An evaluation made before the run was extended that is of this very candidate."""
        while alike := self._alike.get(_of(candidate)):
            stored = self._earlier[alike[0]]
            place = {"index": candidate.index, "generation": candidate.generation}
            try:
                found = self._evaluation(stored | place)
            except DamagedArrays:
                alike.pop(0)
            else:
                self._add({"kind": "again", "number": alike[0], **place})
                return found
        return None

    def _add(self, record: Mapping[str, Any]) -> None:
        self._take(record, self._journal.append(record))

    def _take(self, record: Mapping[str, Any], begins: int) -> None:
        """Learn what a line says; it begins at `begins` in the journal."""
        its = {name: value for name, value in record.items() if name != "kind"}
        match record["kind"]:
            case "generation":
                self.generations.append(Generation(**its))
                self._noted.add(("generation", its["number"]))
                self._objectives[its["number"]] = its["objective"]
            case "insight":
                self.insights.append(Insight(**its | {"best": tuple(its["best"])}))
                self._noted.add(("insight", its["generation"]))
            case "evaluation":
                if isinstance(its["arrays"], dict):
                    its |= {"arrays": None, "begins": begins}
                self._keep(its)
                self._made += 1
            case "again":
                before = self._earlier.pop(its["number"])
                self._alike[_of(_candidate(before))].remove(its["number"])
                self._keep(before | its)
            case "lost":
                del self._stored[its["index"]]
            case "reference":
                self.reference = Reference(**its)
            case "end":
                self.end = its["why"]
            case "extended":
                self._begin_anew(its["header"])
            case other:
                raise ValueError(f"kind {other!r} is unknown")

    def _keep(self, stored: Stored) -> None:
        if stored["index"] in self._stored:
            raise ValueError(f"evaluation {stored['index']} is there twice")
        self._stored[stored["index"]] = stored

    def _begin_anew(self, changed: Mapping[str, Any]) -> None:
        self.header = {**self.header, **changed}
        self._earlier |= {stored["number"]: stored for stored in self._stored.values()}
        self._alike = {}
        for number in sorted(self._earlier):
            its = _of(_candidate(self._earlier[number]))
            self._alike.setdefault(its, []).append(number)
        self._stored, self.generations, self.insights = {}, [], []
        self._noted, self._objectives, self.end = set(), {}, None

    def _read(self, line: Line) -> None:
        try:
            self._take(line.record, line.begins)
        except KeyError as error:
            raise self._journal.damaged(line.number, f"it lacks {error}") from error
        except (TypeError, ValueError, AttributeError) as error:
            raise self._journal.damaged(line.number, str(error)) from error


def create(
    path: Path, study: str, header: Mapping[str, Any], criteria: Criteria = OWN
) -> RunDirectory:
    """Start a run directory at `path` for the study text `study`, judged by `criteria`.

    Raises:
        ConfigError: if there is a run already, or the directory cannot be written.
    """
    if os.path.lexists(path / "run.json"):
        raise ConfigError(f"{path} {HELD}")
    journal = path / "journal.jsonl"
    with disk_errors_named(journal, "read"):
        if os.path.lexists(journal) and journal.stat().st_size:
            raise ConfigError(
                f"{path} holds the journal.jsonl of a run, but no run.json; restore that, or give "
                "another directory"
            )
    header = sealed({**header, "study_check": digest(study.encode())})
    with disk_errors_named(path, "write"):
        (path / "outcomes").mkdir(parents=True, exist_ok=True)
    write_aside(path / "study.toml", study.encode())
    write_aside(journal, b"")
    write_aside(path / "run.json", json.dumps(header, indent=2).encode())
    return RunDirectory(path, header, criteria)


def clear(path: Path) -> None:
    """Remove the run at `path`, of which nothing is worth keeping.

    Raises:
        ConfigError: if the disk refuses it.
    """
    with disk_errors_named(path, "write"):
        write_aside(path / "journal.jsonl", b"")  # first: a run without evaluations is whole
        for file in (path / "outcomes").glob("*.h5"):
            file.unlink()
        (path / "run.json").unlink()


def open_run(path: Path, criteria: Criteria = OWN) -> RunDirectory:
    """Open a finished, running or broken-off run directory, judged by `criteria`.

    An objective that the criteria do not know is taken as it is stored.

    Raises:
        ConfigError: if there is no run, it is of another format, or what is there is damaged.
    """
    run = RunDirectory(path, read_header(path / "run.json"), criteria)
    for line in run._journal.read():
        run._read(line)
    return run


@contextlib.contextmanager
def writing(path: Path) -> Iterator[None]:
    """Hold the run directory for writing, and clear what a killed writer left there.

    That is a torn last line of the journal, and files that were not written to their end.

    Raises:
        ConfigError: if it is a folder of the user's own, another mfopt is writing to it, or the
            disk refuses it.
    """
    check_place(path)
    with held(path):
        with disk_errors_named(path, "write"):
            _clear_leftovers(path)
        if os.path.lexists(path / "journal.jsonl"):
            Journal(path / "journal.jsonl", "").drop_torn_line()
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


def _candidate(stored: Stored) -> Candidate:
    return Candidate(
        stored["index"], frozen(stored["x"]), stored["level"], stored["seed"],
        stored["generation"], stored["purpose"],
    )  # fmt: skip


def _of(candidate: Candidate) -> Of:
    """What an evaluation is of, wherever it stands in the run."""
    return candidate.purpose, candidate.level, candidate.seed, candidate.x.tobytes()


def _fits_json(value: AnyArray) -> bool:
    """Whether JSON gives this number back bit for bit, and with its type."""
    return value.ndim == 0 and value.dtype in (np.int64, np.float64) and bool(np.isfinite(value))
