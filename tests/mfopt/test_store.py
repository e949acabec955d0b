import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from mfopt.errors import ConfigError
from mfopt.evaluation import Candidate, Evaluation, Generation
from mfopt.outcome import Outcome
from mfopt.store import create, open_run, read_arrays, write_arrays, writing


def evaluation(index: int) -> Evaluation:
    x = np.array([0.1, 1.0 / 3.0]) * (index + 1)
    raw = {"passage_times": np.linspace(0.0, 1.0, 5000) / 3.0, "passed": np.asarray(5000)}
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


def test_damage_inside_the_journal_is_refused_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "run"
    create(path, "", {}).add_evaluation(evaluation(0))
    with open(path / "journal.jsonl", "ab") as journal:
        journal.write(b"not json\n")
    with pytest.raises(ConfigError, match="line 2 is damaged"):
        open_run(path)


def test_existing_run_is_never_written_over(tmp_path: Path) -> None:
    create(tmp_path / "run", "first", {})
    with pytest.raises(ConfigError, match="--resume"):
        create(tmp_path / "run", "second", {})
    assert (tmp_path / "run" / "study.toml").read_text() == "first"


def test_run_of_another_format_is_refused(tmp_path: Path) -> None:
    create(tmp_path / "run", "", {})
    header = tmp_path / "run" / "run.json"
    header.write_text(header.read_text().replace('"format": 1', '"format": 99'))
    with pytest.raises(ConfigError, match="format 99"):
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
from mfopt.store import create
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
