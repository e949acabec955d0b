"""Running a simulator as a child process that cannot outlive its run or its caller."""

import contextlib
import json
import os
import secrets
import selectors
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from mfopt.errors import SimulationError

OUTPUT_LIMIT = 2**26  # bytes kept of the standard output of a run, the last ones
LAST_LINES = 20  # kept of the log of a run
LAST_BYTES = 8192  # looked at to find them
CHUNK = 2**16  # bytes read at a time, the capacity of a pipe
LARGEST_PIPE = 2**20  # bytes, as Linux allows to any user; pipe(7)
LONGEST_WAIT_S = 1e6  # [s] at a time, for poll(2)
GRACE_S = 5.0  # [s] that a keeper may take for its own work, besides the time limit

# One thread a run: the runs themselves are what is done in parallel.
ONE_THREAD = {
    f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL", "NUMEXPR", "NUMBA")
}

_KEEPER = Path(__file__).with_name("supervise.py")
_MARK = "MFOPT_RUN"  # environment variable that all processes of a run have, and only they


@dataclass(frozen=True, slots=True)
class Ended:
    """How a child process ended."""

    returncode: int | None  # negative: the signal that ended it; None: its keeper was killed
    timed_out: bool
    output: str  # its standard output, of which the last `OUTPUT_LIMIT` bytes are kept
    cut: bool  # whether there was more output than that
    last_lines: str  # of its standard output, then of its standard error
    last_errors: str  # last lines of its standard error alone
    cpu_s: float  # of the child and its children, all attempts; 0 where its keeper was killed

    @property
    def killed(self) -> bool:
        """Whether somebody else's signal, or a fault of its own memory, ended it.

        A shell that the signal spared says so by 128 plus its number: sh(1).
        """
        code = self.returncode
        by_signal = code is None or code < 0 or 128 < code <= 128 + signal.SIGRTMAX
        return by_signal and not self.timed_out


def run_logged(
    command: Sequence[str], *, directory: Path, time_limit_s: float, stdin: str | None = None
) -> Ended:
    """Run `command` in `directory` and wait for it; keep the end of what it writes.

    The command and all its descendants are killed at the time limit, when this process dies
    (kill -9 included), and when an exception such as an interrupt passes through here. A child
    that a signal ended is run once more, in the same directory.

    Args:
        command: program and arguments.
        directory: where it runs.
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


@dataclass(slots=True)
class _Tail:
    """The last bytes of a stream."""

    limit: int
    _kept: bytearray = field(default_factory=bytearray)  # up to twice as much, to move it rarely
    _bytes: int = 0  # that came

    def add(self, chunk: bytes) -> None:
        self._kept += chunk
        self._bytes += len(chunk)
        if len(self._kept) > 2 * self.limit:
            del self._kept[: -self.limit]

    @property
    def cut(self) -> bool:
        return self._bytes > self.limit

    def text(self) -> str:
        return self._kept[-self.limit :].decode("utf-8", errors="replace")

    def last_lines(self) -> str:
        text = self._kept[-LAST_BYTES:].decode("utf-8", errors="replace")
        return "\n".join(text.splitlines()[-LAST_LINES:])


def _run_once(
    command: Sequence[str], directory: Path, time_limit_s: float, stdin: str | None
) -> Ended:
    out, err, report = _Tail(OUTPUT_LIMIT), _Tail(LAST_BYTES), _Tail(LAST_BYTES)
    with _keeper(command, directory, time_limit_s, stdin) as (keeper, report_fd):
        assert keeper.stdout is not None
        assert keeper.stderr is not None
        streams = {report_fd: report, keeper.stdout.fileno(): out, keeper.stderr.fileno(): err}
        in_time = _listen(streams, report_fd, time_limit_s + GRACE_S)
        if not in_time:
            keeper.send_signal(signal.SIGCONT)  # the command may have stopped its keeper
            _listen(streams, report_fd, GRACE_S)
    last_lines = "\n".join(filter(None, (tail.last_lines() for tail in (out, err))))
    said: dict[str, Any] = {"returncode": None, "timed_out": not in_time, "cpu_s": 0.0}
    if text := report.text():
        said = json.loads(text)
    return Ended(
        output=out.text(), cut=out.cut, last_lines=last_lines, last_errors=err.last_lines(), **said
    )


@contextlib.contextmanager
def _keeper(
    command: Sequence[str], directory: Path, time_limit_s: float, stdin: str | None
) -> Iterator[tuple[subprocess.Popen[bytes], int]]:
    """A keeper with its command, and where the keeper reports; nothing of them is left after."""
    mark = f"{os.getpid()}-{secrets.token_hex(8)}"
    report_fd, into_report = os.pipe()
    with open(report_fd, "rb", buffering=0), open(os.memfd_create("stdin"), "w+b") as given:
        with open(into_report, "wb", buffering=0):
            given.write((stdin or "").encode())
            given.seek(0)
            fds = given.fileno(), into_report
            keeper = subprocess.Popen(
                [sys.executable, "-I", "-S", str(_KEEPER), str(os.getpid()), str(time_limit_s),
                 *map(str, fds), *command],
                stdin=subprocess.PIPE,  # closed when this block is left: the keeper ends all
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                pass_fds=fds,
                cwd=directory,
                env=_environment(directory) | {_MARK: mark},
                start_new_session=True,  # a Ctrl-C at the terminal is the caller's to handle
            )  # fmt: skip
        assert keeper.stdin is not None
        assert keeper.stdout is not None
        assert keeper.stderr is not None
        with keeper.stdout, keeper.stderr:
            try:
                yield keeper, report_fd
            finally:
                keeper.stdin.close()
                _see_it_end(keeper, mark)


def _see_it_end(keeper: subprocess.Popen[bytes], mark: str) -> None:
    """Wait for the keeper to end its run; if it cannot, or was killed, end the run in its place."""
    with contextlib.suppress(ProcessLookupError):
        keeper.send_signal(signal.SIGCONT)
    with contextlib.suppress(subprocess.TimeoutExpired):
        if keeper.wait(GRACE_S) == 0:
            return
    deadline = time.monotonic() + GRACE_S
    while (left := _marked(mark)) and time.monotonic() < deadline:
        for pid in left:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        time.sleep(0.01)
    with contextlib.suppress(subprocess.TimeoutExpired):
        keeper.wait(GRACE_S)


def _marked(mark: str) -> list[int]:
    """Living processes of the run of that mark, the keeper among them."""
    wanted, found = f"{_MARK}={mark}".encode(), []
    for process in Path("/proc").iterdir():
        if process.name.isdigit():
            with contextlib.suppress(OSError):  # gone by now, or another user's
                if wanted in (process / "environ").read_bytes().split(b"\0"):
                    found.append(int(process.name))
    return found


def _listen(streams: dict[int, _Tail], report_fd: int, time_limit_s: float) -> bool:
    """Read the streams until the keeper has ended; False if the time is up first."""
    deadline = time.monotonic() + time_limit_s
    with selectors.DefaultSelector() as selector:
        for fd in streams:
            os.set_blocking(fd, False)
            selector.register(fd, selectors.EVENT_READ)
        while report_fd in selector.get_map():
            ready = selector.select(min(max(0.0, deadline - time.monotonic()), LONGEST_WAIT_S))
            if not ready and time.monotonic() >= deadline:
                return False
            for key, _ in ready:
                if not _read(key.fd, streams[key.fd]):
                    selector.unregister(key.fd)
        for key in selector.get_map().values():  # what was still on the way, but no more
            for _ in range(LARGEST_PIPE // CHUNK):
                _read(key.fd, streams[key.fd])
    return True


def _read(fd: int, tail: _Tail) -> bool:
    """Read what is there; False at the end of the stream, or where nothing is there."""
    try:
        chunk = os.read(fd, CHUNK)
    except BlockingIOError:
        return False
    tail.add(chunk)
    return bool(chunk)


def _environment(directory: Path) -> dict[str, str]:
    # TMPDIR: what a killed command leaves goes with its run.
    # IPYTHONDIR: YADE keeps an IPython history, which concurrent runs would share and lock.
    own = {"TMPDIR": str(directory), "IPYTHONDIR": str(directory)}
    return {**os.environ, **ONE_THREAD, **own, "PATH": os.environ.get("PATH", os.defpath)}
