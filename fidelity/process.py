"""Running a simulator as a child process that cannot outlive its run or its caller."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from mfopt.errors import SimulationError

# Names in the run's directory.
STDIN = "stdin.txt"
STDOUT = "stdout.txt"
STDERR = "stderr.txt"

LAST_LINES = 20  # kept of the log of a run
LAST_BYTES = 8192  # looked at to find them

# One thread a run: the runs themselves are what is done in parallel.
ONE_THREAD = {
    f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMEXPR", "NUMBA")
}

_KEEPER = Path(__file__).with_name("supervise.py")


@dataclass(frozen=True, slots=True)
class Ended:
    """How a child process ended."""

    returncode: int | None  # negative: the signal that ended it; None: its keeper was killed
    timed_out: bool
    last_lines: str  # of its standard output, then of its standard error
    cpu_s: float  # of the child and its children, all attempts

    @property
    def killed(self) -> bool:
        """Whether somebody else's signal, or a fault of its own memory, ended it."""
        return not self.timed_out and (self.returncode is None or self.returncode < 0)


def run_logged(
    command: Sequence[str], *, directory: Path, time_limit_s: float, stdin: str | None = None
) -> Ended:
    """Run `command` in `directory` and wait for it; its output goes to `STDOUT` and `STDERR` there.

    The command and all its descendants are killed at the time limit, when this process dies
    (kill -9 included), and when an exception such as an interrupt passes through here. A child
    that a signal ended is run once more, in the same directory.

    Args:
        command: program and arguments.
        directory: where it runs and where its output is kept.
        time_limit_s: wall-clock limit of one attempt [s].
        stdin: what it reads on its standard input; nothing if None.

    Raises:
        SimulationError: if there is no such program.
    """
    if shutil.which(command[0], path=_environment(directory)["PATH"]) is None:
        raise SimulationError(
            f"program {command[0]} is missing or not executable; install it or give its full path"
        )
    ended = _run_once(command, directory, time_limit_s, stdin)
    if ended.killed:
        spent_s = ended.cpu_s
        ended = _run_once(command, directory, time_limit_s, stdin)
        ended = replace(ended, cpu_s=ended.cpu_s + spent_s)
    return ended


def _run_once(
    command: Sequence[str], directory: Path, time_limit_s: float, stdin: str | None
) -> Ended:
    (directory / STDIN).write_text(stdin or "", encoding="utf-8")
    keeper = [sys.executable, "-I", "-S", str(_KEEPER), str(os.getpid()), str(time_limit_s)]
    with subprocess.Popen(
        [*keeper, STDIN, STDOUT, STDERR, *command],
        stdin=subprocess.PIPE,  # closed when an exception leaves this block: the keeper ends all
        stdout=subprocess.PIPE,
        cwd=directory,
        env=_environment(directory),
        start_new_session=True,  # a Ctrl-C at the terminal is the caller's to handle
    ) as process:
        assert process.stdout is not None
        report = process.stdout.read()
    last_lines = "\n".join(filter(None, (_tail(directory / n) for n in (STDOUT, STDERR))))
    if not report:
        return Ended(None, False, last_lines, 0.0)
    return Ended(last_lines=last_lines, **json.loads(report))


def _environment(directory: Path) -> dict[str, str]:
    # IPYTHONDIR: YADE keeps an IPython history, which concurrent runs would share and lock.
    own = {"IPYTHONDIR": str(directory), "PATH": os.environ.get("PATH", os.defpath)}
    return {**os.environ, **ONE_THREAD, **own}


def _tail(path: Path) -> str:
    """The last lines of a log that may be long or missing."""
    try:
        with path.open("rb") as log:
            log.seek(max(0, path.stat().st_size - LAST_BYTES))
            text = log.read().decode("utf-8", errors="replace")
    except OSError:
        return ""
    return "\n".join(text.splitlines()[-LAST_LINES:])
