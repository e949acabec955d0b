"""Worker processes on this machine: they die with this process, and say why they cannot start."""

import concurrent.futures as cf
import contextlib
import ctypes
import io
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import reduction
from multiprocessing.synchronize import Event
from pathlib import Path
from typing import Any

from mfopt.errors import ConfigError, MfoptError, SimulationError

PR_SET_PDEATHSIG = 1  # prctl(2)
STDERR = 2
LAST_BYTES = 2000  # told of what workers wrote that could not start

UNGUARDED = (
    "a worker process loads the script that started mfopt, and so starts mfopt again; put what "
    'the script does under `if __name__ == "__main__":`, or use workers = 1'
)


def local_processes(workers: int) -> "Callable[[], LocalPool]":
    """A maker of pools of local worker processes.

    Raises:
        ConfigError: if this is a worker that loads a script without a main guard, or if workers
            could not load the script.
    """
    if getattr(multiprocessing.current_process(), "_inheriting", False):
        raise ConfigError(UNGUARDED)
    main = sys.modules["__main__"]
    script = getattr(main, "__file__", None) if main.__spec__ is None else None
    if script is not None and not Path(script).exists():
        raise ConfigError(
            f"worker processes load the script that started mfopt, and {script} is no file; write "
            "the script to a file, or use workers = 1"
        )
    return lambda: LocalPool(workers)


class LocalPool(cf.ProcessPoolExecutor):
    """Processes that die with this one, however it dies.

    What they write to standard error goes to a file until they have started, then to where this
    process writes it.
    """

    def __init__(self, workers: int) -> None:
        context = multiprocessing.get_context("spawn")
        self._started = context.Event()
        self._log = io.FileIO(os.memfd_create("mfopt-workers"), "w+")
        self._stderr = _Handed(STDERR)
        start = (os.getpid(), self._started, self._stderr)
        super().__init__(workers, mp_context=context, initializer=_start, initargs=start)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> cf.Future[Any]:
        """Run a function in a worker; the first call starts the workers.

        Raises:
            BrokenProcessPool: if a worker has died.
        """
        try:
            with contextlib.nullcontext() if self._processes else self._logged():
                return super().submit(fn, *args, **kwargs)
        except OSError as error:
            if self._broken:  # a worker died while another one was started: its pipes are closed
                raise BrokenProcessPool(str(self._broken)) from error
            raise

    @contextlib.contextmanager
    def _logged(self) -> Iterator[None]:
        """Let the processes that start here write to the log first."""
        try:
            usual = os.dup(STDERR)
        except OSError:  # this process was started without one
            usual = os.dup(self._log.fileno())
        self._stderr.fd = usual
        try:
            os.dup2(self._log.fileno(), STDERR)
            yield
        finally:
            os.dup2(usual, STDERR)
            os.close(usual)

    def why_not_started(self) -> MfoptError | None:
        """Why no worker has started yet, of a pool that is broken; None if one had."""
        if self._started.is_set():
            return None
        self._log.seek(max(0, self._log.seek(0, os.SEEK_END) - LAST_BYTES))
        log = self._log.read().decode("utf-8", errors="replace").strip()
        if UNGUARDED in log:
            return ConfigError(UNGUARDED)
        return SimulationError(
            "the worker processes end while they start; the last lines that they wrote:\n"
            + (log or "(none: were they killed, is there too little memory?)")
        )

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the workers, and at once what they are running."""
        for worker in list((self._processes or {}).values()):  # Python 3.14: kill_workers
            worker.kill()
        super().shutdown(wait, cancel_futures=cancel_futures)
        self._log.close()


class _Handed:
    """A file descriptor of this process that is handed to a worker while that is started."""

    def __init__(self, fd: int) -> None:
        self.fd = fd

    def __reduce__(self) -> tuple[Callable[[Any], "_Handed"], tuple[Any]]:
        return _taken, (reduction.DupFd(self.fd),)


def _taken(duplicate: Any) -> _Handed:
    return _Handed(duplicate.detach())


def _start(parent: int, started: Event, stderr: _Handed) -> None:
    """What a worker does first."""
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides what an interrupt means
    if os.getppid() != parent:
        os.kill(os.getpid(), signal.SIGKILL)
    os.dup2(stderr.fd, STDERR)
    os.close(stderr.fd)
    started.set()
