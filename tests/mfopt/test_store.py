import contextlib
import errno
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mfopt.campaign.memory import Memory
from mfopt.campaign.store import create, open_run, writing
from mfopt.errors import ConfigError
from mfopt.files.array_file import read_arrays, write_arrays
from mfopt.records.evaluation import Candidate, Evaluation, Generation
from mfopt.records.objective import RETURNED, Criteria, Objective
from mfopt.records.outcome import Outcome, Status


def evaluation(index: int) -> Evaluation:
    x = np.array([0.1, 1.0 / 3.0]) * (index + 1)
    raw = {"passage_times": (np.linspace(0.0, 1.0, 5000) + index) / 3.0, "passed": np.asarray(5000)}
    outcome = Outcome(x, "coarse", 7, "finished", None, raw, 1e6, 0.25)
    return Evaluation(Candidate(index, x, "coarse", 7, 2), outcome, 1.0 / 7.0)


def test_what_is_written_is_read_back_bit_for_bit(tmp_path: Path) -> None:
    run = create(tmp_path / "run", "text", {"seed": 3})
    written = evaluation(0)
    run.add_generation(Generation(1, "coarse", 0, 0.2, 16, "dispersion", "start"))
    run.add_evaluation(written)
    run.add_end("done")
    again = open_run(tmp_path / "run")
    (read,) = again.evaluations()
    assert (again.end, again.header["seed"], again.generations) == ("done", 3, run.generations)
    assert read.objective == written.objective
    np.testing.assert_array_equal(read.candidate.x, written.candidate.x)
    for name, array in written.outcome.raw.items():
        np.testing.assert_array_equal(read.outcome.raw[name], array)


def test_arrays_of_any_kind_keep_their_shape_and_type(tmp_path: Path) -> None:
    arrays = {"none": np.empty((0, 3)), "flags": np.array([True, False]), "one": np.array(1 + 2j),
              "packed": np.arange(5000, dtype="i2").reshape(50, 100)}  # fmt: skip
    write_arrays(tmp_path / "a.h5", arrays)
    read = read_arrays(tmp_path / "a.h5")
    assert read.keys() == arrays.keys()
    for name, array in arrays.items():
        np.testing.assert_array_equal(read[name], array, strict=True)


def test_failed_run_keeps_its_reason_and_stays_infinite(tmp_path: Path) -> None:
    run = create(tmp_path / "run", "", {})
    x = np.zeros(2)
    outcome = Outcome(x, "l", 1, "crashed", "exploded")
    run.add_evaluation(Evaluation(Candidate(0, x, "l", 1), outcome, float("inf")))
    (read,) = open_run(tmp_path / "run").evaluations()
    assert (read.outcome.status, read.outcome.why, read.objective) == (
        "crashed", "exploded", float("inf"),
    )  # fmt: skip


def test_torn_last_line_is_dropped_and_the_journal_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "run"
    run = create(path, "", {})
    run.add_evaluation(evaluation(0))
    with open(path / "journal.jsonl", "ab") as journal:
        journal.write(b'{"kind": "evaluation", "ind')
    with writing(path):
        run = open_run(path)
        run.add_evaluation(evaluation(1))
    assert [e.candidate.index for e in open_run(path).evaluations()] == [0, 1]


def test_next_writer_clears_what_a_killed_one_left(tmp_path: Path) -> None:
    path = tmp_path / "run"
    create(path, "", {}).add_evaluation(evaluation(0))
    gone, lives = 2**22 + 1, 1  # above the kernel's highest process number, and init
    left = [path / "outcomes" / f".1.h5.{lives}", path / f".run.json.{gone}",
            path / f".report.html.{gone}"]  # fmt: skip
    kept = [path / f".report.pdf.{lives}", path / ".own", path / "outcomes" / "0.h5"]
    for file in left + kept[:2]:
        file.write_text("")
    with writing(path):
        assert [file for file in left + kept if file.exists()] == kept


def stored(path: Path, evaluations: int = 3) -> list[bytes]:
    """Write a run, and return the lines of its journal."""
    run = create(path, "", {"seed": 3})
    for index in range(evaluations):
        run.add_evaluation(evaluation(index))
    return (path / "journal.jsonl").read_bytes().splitlines(keepends=True)


def other_objective(line: bytes) -> bytes:
    changed = line.replace(b'"objective": 0.14', b'"objective": 0.13')
    assert changed != line
    return changed


@pytest.mark.parametrize(
    ("damage", "line"),
    [
        (lambda a, b, c: [a, b"not json\n", b, c], 2),
        (lambda a, b, c: [a, b'{"kind": "end", "why": "done"}\n', b, c], 2),
        (lambda a, b, c: [a, b"[]\n", b, c], 2),
        (lambda a, b, c: [a, b"\n", b, c], 2),
        (lambda a, b, c: [a, b"\x00\xff" * 300 + b"\n", b, c], 2),
        (lambda a, b, c: [a, b, other_objective(c)], 3),
        (lambda a, b, c: [a, b, b, c], 3),  # twice
        (lambda a, b, c: [a, c], 2),  # removed
        (lambda a, b, c: [b, c], 1),
        (lambda a, b, c: [a, c, b], 2),  # moved
        (lambda a, b, c: [a, b[:100] + c], 2),
    ],
)
def test_damage_of_the_journal_is_refused_with_its_line(
    damage: Callable[..., list[bytes]], line: int, tmp_path: Path
) -> None:
    path = tmp_path / "run"
    (path / "journal.jsonl").write_bytes(b"".join(damage(*stored(path))))
    with pytest.raises(ConfigError, match=f"line {line} is damaged.*first {line - 1} lines"):
        open_run(path)
    lines = (path / "journal.jsonl").read_bytes().splitlines(keepends=True)
    (path / "journal.jsonl").write_bytes(b"".join(lines[: line - 1]))  # what the message says
    assert [e.candidate.index for e in open_run(path).evaluations()] == list(range(line - 1))


def test_a_journal_of_another_run_is_refused(tmp_path: Path) -> None:
    create(tmp_path / "other", "", {"seed": 4}).add_end("done")
    stored(tmp_path / "run")
    shutil.copy(tmp_path / "other" / "journal.jsonl", tmp_path / "run")
    with pytest.raises(ConfigError, match="line 1 is damaged"):
        open_run(tmp_path / "run")


@pytest.mark.parametrize(
    ("old", "new"),
    [(b'"seed": 3', b'"seed": 4'), (b'"format": 2,', b""), (b"{", b"["), (b"3,", b"\xff\xfe,"),
     (b"{", b"[{"), (b'"seed": 3', b'"seed": ' + 2000 * b"[")],
)  # fmt: skip
def test_a_damaged_header_is_refused(old: bytes, new: bytes, tmp_path: Path) -> None:
    stored(tmp_path / "run")
    header = tmp_path / "run" / "run.json"
    assert old in header.read_bytes()
    header.write_bytes(header.read_bytes().replace(old, new, 1))
    with pytest.raises(ConfigError, match=r"run\.json is damaged|in format None"):
        open_run(tmp_path / "run")


def test_header_of_another_kind_is_refused(tmp_path: Path) -> None:
    for content in ("[1]", "3", "null", '"format"', '{"format": [2]}', ""):
        (tmp_path / "run.json").write_text(content)
        with pytest.raises(ConfigError):
            open_run(tmp_path)


@pytest.mark.parametrize("name", ["run.json", "journal.jsonl", "study.toml"])
@pytest.mark.parametrize("kind", ["missing", "directory", "loop"])
def test_what_is_no_file_is_named(name: str, kind: str, tmp_path: Path) -> None:
    stored(tmp_path / "run")
    file = tmp_path / "run" / name
    file.unlink()
    if kind == "directory":
        file.mkdir()
    elif kind == "loop":
        file.symlink_to(file)
    with pytest.raises(ConfigError, match=rf"{name.replace('.', '.')}"):
        open_run(tmp_path / "run").study()


def test_a_study_that_is_not_the_one_given_is_named(tmp_path: Path) -> None:
    path = tmp_path / "run"
    run = create(path, "given", {})
    assert open_run(path).study() == "given"
    (path / "study.toml").write_bytes(b"\xff\xfe")
    with pytest.raises(ConfigError, match="is not the study of this run"):
        run.study()


def damage_file(file: Path, kind: str) -> None:
    content = bytearray(file.read_bytes())
    match kind:
        case "of another run":
            content = bytearray((file.parent / "1.h5").read_bytes())
        case "64 bytes":
            middle = len(content) // 2
            content[middle : middle + 64] = np.random.default_rng(1).bytes(64)
        case "a bit":
            content[-20] ^= 1
        case "cut":
            content = content[: len(content) // 2]
        case "empty":
            content.clear()
    if kind == "missing":
        file.unlink()
    else:
        file.write_bytes(content)


@pytest.mark.parametrize("kind", ["of another run", "64 bytes", "a bit", "cut", "empty", "missing"])
def test_damaged_arrays_are_never_used_and_made_again(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "run"
    stored(path)
    damage_file(path / "outcomes" / "2.h5", kind)
    run, candidate = open_run(path), evaluation(2).candidate
    with pytest.raises(ConfigError, match=r"evaluation 2 .*2\.h5.*--resume. makes it again"):
        list(run.evaluations())
    assert Memory(run).recall(candidate) is None
    run.add_evaluation(evaluation(2))
    again = list(open_run(path).evaluations())
    assert [e.candidate.index for e in again] == [0, 1, 2]
    np.testing.assert_array_equal(
        again[2].outcome.raw["passage_times"], evaluation(2).outcome.raw["passage_times"]
    )


def test_an_evaluation_twice_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "run"
    stored(path)
    journal = open_run(path)._journal
    journal.append({"kind": "extended", "header": {}})  # not even a writer gone wrong is trusted
    for _ in range(2):
        journal.append({"kind": "again", "number": 1, "index": 0, "generation": 0})
    with pytest.raises(ConfigError, match="line 6 is damaged"):
        open_run(path)


@pytest.mark.parametrize(
    "record",
    [{"kind": "generation"}, {"kind": "evaluation", "index": 0}, {"kind": "insight", "best": 3},
     {"kind": "end"}, {"kind": "lost", "index": 9}, {"kind": "unheard of"}, {"index": 3},
     {"kind": "extended", "header": 3}, {"kind": "generation", "number": 1, "other": 2}],
)  # fmt: skip
def test_a_line_that_lacks_something_is_named(record: dict[str, Any], tmp_path: Path) -> None:
    stored(tmp_path / "run")
    open_run(tmp_path / "run")._journal.append(record)
    with pytest.raises(ConfigError, match="line 4 is damaged"):
        open_run(tmp_path / "run")


def test_an_objective_that_its_outcome_does_not_give_is_refused(tmp_path: Path) -> None:
    lacking = Objective("g", lambda raw: {"g": float(raw["g"])})
    judged_by = Criteria({"returned": RETURNED, "g": lacking})
    run, x = create(tmp_path / "run", "", {"objective": "returned"}, judged_by), np.zeros(2)

    def add(index: int, stored: float, given: float, status: Status = "finished") -> None:
        outcome = Outcome(x, "l", 1, status, None, {"f": np.asarray(given)})
        run.add_evaluation(Evaluation(Candidate(index, x, "l", 1, 4), outcome, stored))

    add(0, 0.5, 0.5)
    add(1, 0.5, 0.5 * (1.0 + 1e-12))
    add(2, float("inf"), 0.5, "crashed")
    assert len(list(open_run(tmp_path / "run").evaluations())) == 3
    add(3, 0.5, 0.6)
    with pytest.raises(ConfigError, match=r"evaluation 3 .* objective 0\.5, .* gives 0\.59999"):
        list(open_run(tmp_path / "run").evaluations())
    run.extend({}, "")
    run.add_generation(Generation(4, "l", 0, 0.2, 16, "g"))  # another objective ranks it
    with pytest.raises(ConfigError, match=r"evaluation 0 .* gives inf"):
        run.use_again(Candidate(0, x, "l", 1, 4))


SMALL = {
    "scalar": np.asarray(0.1), "single": np.asarray(0.1, dtype="f4"), "none": np.empty((0, 3)),
    "flags": np.array([True, False]), "inf": np.asarray(np.inf), "words": np.array(["é", "b"]),
    "": np.arange(3), ".": np.arange(4), "a": np.ones(2), "a/b": np.zeros((2, 2)), "/": np.ones(1),
    "%": np.ones(3), "\x00": np.ones(1), "\ud800": np.ones(1), "long": np.ones(2, dtype="g"),
    "fortran": np.asfortranarray(np.arange(6.0).reshape(2, 3)), "big": np.arange(3, dtype=">i2"),
}  # fmt: skip


@pytest.mark.parametrize("large", [False, True])
def test_small_arrays_need_no_file_and_any_name_and_kind_is_kept(
    large: bool, tmp_path: Path
) -> None:
    raw = dict(SMALL)
    if large:
        raw = {n: a for n, a in SMALL.items() if n not in ("words", "long")}
        raw["many"] = np.linspace(0.0, 1.0, 5000)
    run, x = create(tmp_path / "run", "", {}), np.zeros(2)
    outcome = Outcome(x, "l", 1, "finished", None, raw)
    run.add_evaluation(Evaluation(Candidate(0, x, "l", 1), outcome, 0.5))
    assert len(list((tmp_path / "run" / "outcomes").iterdir())) == large
    for its in (run, open_run(tmp_path / "run")):
        (read,) = its.evaluations()
        assert read.outcome.raw.keys() == raw.keys()
        for name, array in raw.items():
            np.testing.assert_array_equal(read.outcome.raw[name], array, strict=True)


@pytest.mark.parametrize("number", [errno.EIO, errno.ENOSPC])
@pytest.mark.parametrize("write", range(8))
def test_a_write_that_fails_loses_nothing_and_the_next_start_goes_on(
    write: int, number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each evaluation syncs its arrays, the folder and the journal; the n-th sync fails."""
    path, calls, real = tmp_path / "run", iter(range(100)), os.fsync

    def refuse(file: int) -> None:
        if next(calls) == write:
            raise OSError(number, os.strerror(number))
        real(file)

    create(path, "", {})
    monkeypatch.setattr(os, "fsync", refuse)
    run = open_run(path)
    with contextlib.suppress(ConfigError):
        for index in range(3):
            run.add_evaluation(evaluation(index))
    monkeypatch.undo()
    with writing(path):
        run = open_run(path)
        there = len(run)
        assert there >= write // 3
        for index in range(there, 4):
            run.add_evaluation(evaluation(index))
    assert [e.candidate.index for e in open_run(path).evaluations()] == [0, 1, 2, 3]


def test_existing_run_is_never_written_over(tmp_path: Path) -> None:
    create(tmp_path / "run", "first", {})
    with pytest.raises(ConfigError, match="--resume"):
        create(tmp_path / "run", "second", {})
    assert (tmp_path / "run" / "study.toml").read_text() == "first"


def test_a_journal_without_its_header_is_never_written_over(tmp_path: Path) -> None:
    lines = stored(tmp_path / "run")
    (tmp_path / "run" / "run.json").unlink()
    with pytest.raises(ConfigError, match=r"journal\.jsonl of a run, but no run\.json; restore"):
        create(tmp_path / "run", "", {"seed": 3})
    assert (tmp_path / "run" / "journal.jsonl").read_bytes() == b"".join(lines)
    (tmp_path / "run" / "journal.jsonl").write_bytes(b"")  # a kill may leave this of a new run
    create(tmp_path / "run", "", {"seed": 3})


def test_run_of_another_format_is_refused(tmp_path: Path) -> None:
    create(tmp_path / "run", "", {})
    header = tmp_path / "run" / "run.json"
    written = header.read_text()
    for number, reader in ((1, r"use mfopt 0\.1"), (99, "use the version of mfopt that wrote it")):
        header.write_text(written.replace('"format": 2', f'"format": {number}'))
        with pytest.raises(ConfigError, match=f"format {number}.*{reader}"):
            open_run(tmp_path / "run")


def test_second_writer_is_refused(tmp_path: Path) -> None:
    create(tmp_path / "run", "", {})
    with (
        writing(tmp_path / "run"),
        pytest.raises(ConfigError, match="another mfopt"),
        writing(tmp_path / "run"),
    ):
        pass


WRITER = """
import sys
sys.path.insert(0, {tests!r})
from pathlib import Path
from mfopt.campaign.store import create
from test_store import evaluation
run = create(Path(sys.argv[1]), "", {{}})
print("ready", flush=True)
for index in range(100_000):
    run.add_evaluation(evaluation(index))
"""


@pytest.mark.parametrize("delay_s", [0.05, 0.11, 0.2])
def test_kill_at_any_instant_leaves_a_readable_run(tmp_path: Path, delay_s: float) -> None:
    path = tmp_path / "run"
    code = WRITER.format(tests=str(Path(__file__).parent))
    with subprocess.Popen(
        [sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE
    ) as writer:
        assert writer.stdout is not None
        writer.stdout.readline()
        time.sleep(delay_s)
        os.kill(writer.pid, signal.SIGKILL)
    with writing(path):
        evaluations = list(open_run(path).evaluations())
    assert [e.candidate.index for e in evaluations] == list(range(len(evaluations)))
    for e in evaluations:
        assert e.outcome.raw["passage_times"].shape == (5000,)


def test_damaged_array_file_is_named(tmp_path: Path) -> None:
    (tmp_path / "3.h5").write_bytes(b"no hdf5")
    with pytest.raises(ConfigError, match=r"3\.h5"):
        read_arrays(tmp_path / "3.h5")


def test_full_disk_loses_nothing_that_was_written(tmp_path: Path) -> None:
    small = tmp_path / "small"
    small.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=300k", "tmpfs", str(small)]
    if subprocess.run(mount, capture_output=True, check=False).returncode != 0:
        pytest.skip("needs the right to mount a small file system")
    try:
        run = create(small / "run", "", {})

        def fill() -> None:
            for index in range(1000):
                run.add_evaluation(evaluation(index))

        with pytest.raises(ConfigError, match="no disk space left"):
            fill()
        with writing(small / "run"):
            again = list(open_run(small / "run").evaluations())
        assert [e.candidate.index for e in again] == list(range(len(again)))
        assert 0 < len(again) < 1000
    finally:
        subprocess.run(["umount", str(small)], check=True)
