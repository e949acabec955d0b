"""Worker processes: what keeps them from starting or loading a function is said in one line."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from fidelity.programs.function import FunctionLevel
from mfopt.campaign.executor import Runner
from mfopt.campaign.local_workers import local_processes
from mfopt.errors import ConfigError, SimulationError
from mfopt.records.level import Ladder
from mfopt.study.minimize import minimize

PATIENCE_S = 60.0


def closure() -> object:
    offset = 1.0
    return lambda x, seed: x[0] + offset


@pytest.mark.parametrize("function", [lambda x, seed: float(x[0]), closure()])
def test_a_function_that_cannot_be_sent_is_found_before_anything_runs(
    function: object, tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match=r"level 'f' cannot be loaded .* top of a module") as said:
        minimize({"f": function}, {"a": (0, 1)}, workers=2, directory=tmp_path / "run")  # type: ignore[dict-item]
    assert len(str(said.value).splitlines()) == 1
    assert not (tmp_path / "run").exists()


SCRIPT = """
import mfopt

def square(x, seed):
    return float(x[0] ** 2)

def search():
    found = mfopt.minimize({"f": square}, {"a": (-1, 1)}, generations=2, workers=2)
    print("found", found.f < 1)
"""


def run(
    script: str, directory: Path, *, stdin: bool = False, command: tuple[str, ...] = ()
) -> subprocess.CompletedProcess[str]:
    path = directory / "script.py"
    path.write_text(script, encoding="utf-8")
    return subprocess.run(
        [*command, sys.executable, "-" if stdin else str(path)],
        input=script if stdin else "",
        text=True,
        capture_output=True,
        timeout=PATIENCE_S,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        check=False,
    )


def test_a_script_with_a_main_guard_runs(tmp_path: Path) -> None:
    done = run(SCRIPT + 'if __name__ == "__main__":\n    search()\n', tmp_path)
    assert (done.stdout, done.stderr, done.returncode) == ("found True\n", "", 0)


def test_a_script_without_a_main_guard_is_told_once(tmp_path: Path) -> None:
    done = run(SCRIPT + "search()\n", tmp_path)
    assert done.returncode == 1
    assert done.stderr.count("Traceback") == 1
    assert "ConfigError: a worker process loads the script" in done.stderr.splitlines()[-1]
    assert '`if __name__ == "__main__":`' in done.stderr.splitlines()[-1]


def test_a_script_that_is_no_file_is_told_to_become_one(tmp_path: Path) -> None:
    done = run(SCRIPT + "search()\n", tmp_path, stdin=True)
    assert done.returncode == 1
    assert done.stderr.count("Traceback") == 1
    assert "<stdin> is no file; write the script to a file" in done.stderr.splitlines()[-1]


def test_a_function_typed_at_a_prompt_is_told_to_become_a_module(tmp_path: Path) -> None:
    # As at a prompt or in a notebook, the main module has no file that a worker could load.
    done = run("import sys; del __file__\n" + SCRIPT + "search()\n", tmp_path)
    assert done.returncode == 1
    assert done.stderr.count("Traceback") == 1
    assert "level 'f' cannot be loaded by a worker process" in done.stderr.splitlines()[-1]
    assert "at a prompt" in done.stderr.splitlines()[-1]


def test_a_program_without_a_standard_error_has_workers(tmp_path: Path) -> None:
    script = SCRIPT + 'if __name__ == "__main__":\n    search()\n'
    done = run(script, tmp_path, command=("sh", "-c", 'exec "$@" 2>&-', "sh"))
    assert (done.stdout, done.returncode) == ("found True\n", 0)


def test_workers_that_die_while_they_start_end_the_study_and_say_why(tmp_path: Path) -> None:
    # The main module works here and fails in the worker, as where a library is missing there.
    script = """
import sys
from mfopt.errors import SimulationError
from mfopt.records.evaluation import Candidate
from mfopt.campaign.executor import Runner
from mfopt.records.level import Ladder
from fidelity.programs.function import FunctionLevel
from mfopt.campaign.local_workers import local_processes
import numpy as np

if __name__ != "__main__":
    raise ImportError("libsolver.so.3 is not there")

ladder = Ladder((FunctionLevel("f", max),))
try:
    list(Runner(local_processes(2)).run(ladder, [Candidate(0, np.zeros(1), "f", 1)]))
except SimulationError as error:
    print(error)
"""
    done = run(script, tmp_path)
    assert done.stdout.startswith("the worker processes end while they start; the last lines")
    assert "ImportError: libsolver.so.3 is not there" in done.stdout
    assert (done.stderr, done.returncode) == ("", 0)


def test_after_their_start_workers_write_to_our_standard_error(
    capfd: pytest.CaptureFixture[str],
) -> None:
    pool = local_processes(1)()
    pool.submit(os.write, 2, b"from a worker\n").result()
    pool.shutdown()
    os.write(2, b"from here\n")
    assert capfd.readouterr().err == "from a worker\nfrom here\n"


def test_shutdown_ends_what_is_running_and_leaves_no_process() -> None:
    pool = local_processes(2)()
    pids = [pool.submit(os.getpid).result() for _ in range(2)]
    pool.submit(time.sleep, 600.0)
    began = time.monotonic()
    pool.shutdown()
    assert time.monotonic() - began < PATIENCE_S
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def killed(*_: object) -> None:
    """As if memory had run out."""
    os.kill(os.getpid(), signal.SIGKILL)


def test_no_worker_at_all_where_all_are_killed_at_their_start(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("mfopt.campaign.local_workers._start", killed)
    runner = Runner(local_processes(1))
    with pytest.raises(SimulationError, match="too little memory"):
        runner.check(Ladder((FunctionLevel("f", max),)))
    runner.close()
