"""Child processes: what they return, and that nothing of them is left in any case."""

import os
import resource
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from fidelity.engines.exchange import read_movement
from fidelity.programs import process
from fidelity.programs.process import OUTPUT_LIMIT, run_logged
from mfopt.errors import SimulationError

PATIENCE_S = 30.0  # for what happens within milliseconds on a machine that is not stuck


def sh(script: str) -> list[str]:
    return ["sh", "-c", script]


def alive(pid: int) -> bool:
    """Whether the process runs; a zombie that nobody has reaped does not."""
    try:
        status = Path(f"/proc/{pid}/stat").read_text(encoding="ascii")
    except (FileNotFoundError, ProcessLookupError):
        return False
    return status.rpartition(")")[2].split()[0] != "Z"


def wait_until_gone(pids: list[int]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while any(alive(pid) for pid in pids):
        assert time.monotonic() < deadline, f"still there: {[p for p in pids if alive(p)]}"
        time.sleep(0.01)


def read_pids(path: Path, count: int) -> list[int]:
    deadline = time.monotonic() + PATIENCE_S
    while True:
        pids = [int(word) for word in path.read_text().split()] if path.exists() else []
        if len(pids) == count:
            return pids
        assert time.monotonic() < deadline
        time.sleep(0.01)


# Writes its own id, that of a child and that of a grandchild in a session of its own.
FAMILY = (
    "echo $$ >> pids; sleep 600 & echo $! >> pids;"
    "setsid sh -c 'echo $$ >> pids; sleep 600 & echo $! >> pids; wait' & wait"
)
FAMILY_SIZE = 4


def test_result_of_a_child(tmp_path: Path) -> None:
    ended = run_logged(
        sh("cat; pwd; echo trouble >&2; exit 3"),
        directory=tmp_path,
        time_limit_s=60.0,
        stdin="given\n",
    )
    assert (ended.returncode, ended.timed_out) == (3, False)
    assert ended.last_lines.splitlines() == ["given", str(tmp_path), "trouble"]
    assert ended.output == f"given\n{tmp_path}\n"
    assert not ended.cut


def test_only_the_last_lines_are_kept(tmp_path: Path) -> None:
    ended = run_logged(sh("seq 100000"), directory=tmp_path, time_limit_s=60.0)
    lines = ended.last_lines.splitlines()
    assert lines[-1] == "100000"
    assert len(lines) == 20


def test_of_a_long_output_the_end_is_kept_in_bounded_memory(tmp_path: Path) -> None:
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    script = f"head -c {10 * OUTPUT_LIMIT} /dev/zero; echo; echo the end"
    ended = run_logged(sh(script), directory=tmp_path, time_limit_s=60.0)
    assert (ended.returncode, ended.cut) == (0, True)
    assert len(ended.output) == OUTPUT_LIMIT
    assert ended.output.endswith("\nthe end\n")
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 6 * OUTPUT_LIMIT / 1024
    assert list(tmp_path.iterdir()) == []  # nor is it on the disk


def test_a_log_without_end_is_read_until_the_time_limit(tmp_path: Path) -> None:
    ended = run_logged(sh("yes >&2"), directory=tmp_path, time_limit_s=0.5)
    assert ended.timed_out
    assert ended.last_lines.splitlines()[-1] == "y"


def test_cpu_time_counts_children_and_what_was_killed(tmp_path: Path) -> None:
    burn = f"{sys.executable} -c 'while True: pass'"
    ended = run_logged(sh(f"{burn} & {burn}"), directory=tmp_path, time_limit_s=1.0)
    assert ended.timed_out
    assert ended.cpu_s > 0.05  # a shell that only waits takes a few milliseconds


def test_one_thread_unless_the_child_says_otherwise(tmp_path: Path) -> None:
    ended = run_logged(sh("echo $OMP_NUM_THREADS"), directory=tmp_path, time_limit_s=60.0)
    assert ended.last_lines == "1"


def test_missing_program(tmp_path: Path) -> None:
    with pytest.raises(SimulationError, match="no-such-program is missing"):
        run_logged(["no-such-program"], directory=tmp_path, time_limit_s=60.0)


def test_program_that_cannot_be_executed(tmp_path: Path) -> None:
    program = tmp_path / "program"
    program.write_text("#!/no/such/interpreter\n")
    program.chmod(0o755)
    ended = run_logged([str(program)], directory=tmp_path, time_limit_s=60.0)
    assert ended.returncode == 127
    assert "cannot start" in ended.last_lines


def test_killed_child_is_run_once_more(tmp_path: Path) -> None:
    script = "if [ -e tried ]; then echo fine; else touch tried; kill -9 $$; fi"
    ended = run_logged(sh(script), directory=tmp_path, time_limit_s=60.0)
    assert (ended.returncode, ended.last_lines) == (0, "fine")


def test_a_program_killed_inside_a_shell_is_run_once_more(tmp_path: Path) -> None:
    inner = "if [ -e tried ]; then echo fine; else touch tried; kill -9 $$; fi"
    ended = run_logged(sh(f"sh -c '{inner}'; exit $?"), directory=tmp_path, time_limit_s=60.0)
    assert (ended.returncode, ended.last_lines.splitlines()[-1]) == (0, "fine")


def test_child_killed_twice_is_reported(tmp_path: Path) -> None:
    script = "echo try >> tries; kill -9 $$"
    ended = run_logged(sh(script), directory=tmp_path, time_limit_s=60.0)
    assert ended.returncode == -signal.SIGKILL
    assert (tmp_path / "tries").read_text() == "try\ntry\n"


def test_child_that_fails_is_not_run_again(tmp_path: Path) -> None:
    ended = run_logged(sh("echo try >> tries; exit 1"), directory=tmp_path, time_limit_s=60.0)
    assert ended.returncode == 1
    assert (tmp_path / "tries").read_text() == "try\n"


def test_time_limit_ends_all_descendants(tmp_path: Path) -> None:
    ended = run_logged(sh(FAMILY), directory=tmp_path, time_limit_s=3.0)
    assert ended.timed_out
    assert not ended.killed
    pids = read_pids(tmp_path / "pids", FAMILY_SIZE)
    assert not any(alive(pid) for pid in pids)


def test_nothing_is_left_when_the_child_ends_before_its_children(tmp_path: Path) -> None:
    script = "sleep 600 & echo $! >> pids; setsid sleep 600 & echo $! >> pids; exit 0"
    ended = run_logged(sh(script), directory=tmp_path, time_limit_s=60.0)
    assert ended.returncode == 0
    assert not any(alive(pid) for pid in read_pids(tmp_path / "pids", 2))


def test_thread_that_started_the_child_may_end(tmp_path: Path) -> None:
    # A death signal tied to the starting thread would kill the child of the first thread.
    results = []

    def run() -> None:
        results.append(run_logged(sh("sleep 0.3"), directory=tmp_path, time_limit_s=60.0))

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert results[0].returncode == 0


CALLER = """
import signal, sys
from pathlib import Path
from fidelity.programs.process import run_logged
signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background ignores it
run_logged(["sh", "-c", sys.argv[2]], directory=Path(sys.argv[1]), time_limit_s=600.0)
"""


def start_caller(directory: Path, script: str) -> subprocess.Popen[bytes]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    return subprocess.Popen([sys.executable, "-c", CALLER, str(directory), script], env=environment)


def keeper_of(caller: int) -> int:
    children = Path(f"/proc/{caller}/task/{caller}/children").read_text().split()
    assert len(children) == 1
    return int(children[0])


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_nothing_is_left_when_the_caller_is_killed(tmp_path: Path, how: signal.Signals) -> None:
    caller = start_caller(tmp_path, FAMILY)
    pids = read_pids(tmp_path / "pids", FAMILY_SIZE)
    pids.append(keeper_of(caller.pid))
    caller.send_signal(how)
    caller.wait(PATIENCE_S)
    wait_until_gone(pids)


def test_child_dies_with_its_keeper_and_is_run_again(tmp_path: Path) -> None:
    script = "echo $$ >> pids; if [ -e tried ]; then exit 0; fi; touch tried; exec sleep 600"
    caller = start_caller(tmp_path, script)
    first = read_pids(tmp_path / "pids", 1)
    while not (tmp_path / "tried").exists():
        time.sleep(0.01)
    os.kill(keeper_of(caller.pid), signal.SIGKILL)
    assert caller.wait(PATIENCE_S) == 0
    wait_until_gone(first)
    assert len(read_pids(tmp_path / "pids", 2)) == 2


@pytest.fixture
def _little_grace(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process, "GRACE_S", 1.0)


@pytest.mark.usefixtures("_little_grace")
def test_a_stopped_keeper_is_ended_at_the_time_limit(tmp_path: Path) -> None:
    began = time.monotonic()
    script = f"kill -STOP $PPID; {FAMILY}"
    ended = run_logged(sh(script), directory=tmp_path, time_limit_s=0.5)
    assert ended.timed_out
    assert time.monotonic() - began < PATIENCE_S
    assert not any(alive(pid) for pid in read_pids(tmp_path / "pids", FAMILY_SIZE))


@pytest.mark.usefixtures("_little_grace")
def test_a_keeper_that_is_stopped_again_and_again_is_killed_with_its_run(tmp_path: Path) -> None:
    script = f"while :; do kill -STOP $PPID; done & echo $! >> pids; {FAMILY}"
    ended = run_logged(sh(script), directory=tmp_path, time_limit_s=0.5)
    assert ended.timed_out
    wait_until_gone(read_pids(tmp_path / "pids", FAMILY_SIZE + 1))


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_a_stopped_keeper_does_not_outlive_its_caller(tmp_path: Path, how: signal.Signals) -> None:
    caller = start_caller(tmp_path, f"kill -STOP $PPID; {FAMILY}")
    pids = read_pids(tmp_path / "pids", FAMILY_SIZE)
    pids.append(keeper_of(caller.pid))
    caller.send_signal(how)
    caller.wait(PATIENCE_S)
    wait_until_gone(pids)


def test_no_descendant_outlives_a_killed_keeper(tmp_path: Path) -> None:
    caller = start_caller(tmp_path, f"[ -e pids ] || {{ {FAMILY}; }}")
    pids = read_pids(tmp_path / "pids", FAMILY_SIZE)
    os.kill(keeper_of(caller.pid), signal.SIGKILL)
    assert caller.wait(PATIENCE_S) == 0
    wait_until_gone(pids)


def test_named_pipes_in_place_of_files_hold_nothing_up(tmp_path: Path) -> None:
    names = "stdin.txt stdout.txt stderr.txt result.json result.npz"
    script = f"rm -f {names}; mkfifo {names}; [ -e tried ] || {{ touch tried; kill -9 $$; }}"
    ended = run_logged(sh(script), directory=tmp_path, time_limit_s=60.0)
    assert (ended.returncode, ended.timed_out) == (0, False)
    assert read_movement(tmp_path, cpu_s=0.0) is None
