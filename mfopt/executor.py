"""Where runs are made: here, in local processes, or on a Dask cluster; one seam for all.

Everything goes through `concurrent.futures.Executor`. A worker process that dies takes
its pool with it; the pool is made anew and what was lost is run once more. A run that kills
its worker a second time, alone, is recorded as crashed.
"""

import concurrent.futures as cf
import ctypes
import multiprocessing
import os
import signal
import tempfile
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mfopt.errors import ConfigError
from mfopt.evaluation import Candidate
from mfopt.level import Ladder, Level
from mfopt.outcome import Outcome
from mfopt.store import full_disk_named

MakeExecutor = Callable[[], cf.Executor]
PR_SET_PDEATHSIG = 1  # prctl(2)


@dataclass(slots=True)
class Runner:
    """Makes runs through an executor, which it makes anew if it breaks."""

    make: MakeExecutor
    _executor: cf.Executor | None = None

    def run(
        self, ladder: Ladder, candidates: Sequence[Candidate]
    ) -> Iterator[tuple[Candidate, Outcome]]:
        """Evaluate the candidates; yield each as it ends."""
        lost = yield from self._together(ladder, candidates)
        if lost:  # one of them killed its worker: once more together, then one by one
            lost = yield from self._together(ladder, lost)
        for candidate in lost:
            if (yield from self._together(ladder, [candidate])):
                why = "the worker process died twice while running this design"
                yield candidate, _crashed(candidate, why)

    def close(self) -> None:
        """End the workers, and at once what they are running."""
        if self._executor is not None:
            # Python 3.14 calls this `kill_workers`; other executors have no processes here.
            for worker in list((getattr(self._executor, "_processes", None) or {}).values()):
                worker.kill()
            self._executor.shutdown(cancel_futures=True)
            self._executor = None

    def _together(
        self, ladder: Ladder, candidates: Sequence[Candidate]
    ) -> Generator[tuple[Candidate, Outcome], None, list[Candidate]]:
        self._executor = self._executor or self.make()
        waiting: dict[cf.Future[Outcome], Candidate] = {}
        lost: list[Candidate] = []
        try:
            for c in candidates:
                future = self._executor.submit(evaluate, ladder[c.level], c.x, c.seed)
                waiting[future] = c
            for future in cf.as_completed(list(waiting)):
                outcome = _result(future, waiting[future])
                yield waiting.pop(future), outcome
        except BrokenProcessPool:
            lost = sorted(waiting.values(), key=lambda c: c.index)
            self.close()
        return lost


def evaluate(level: Level, x: Any, seed: int) -> Outcome:
    """Evaluate in a worker; an unexpected exception of a level is a crashed run.

    Raises:
        ConfigError: if no level could run here: a missing program, a full disk.
    """
    try:
        with full_disk_named(Path(tempfile.gettempdir())):
            return level.evaluate(x, seed=seed)
    except ConfigError:
        raise
    except Exception as error:
        return Outcome(x, level.name, seed, "crashed", f"{type(error).__name__}: {error}")


def _result(future: cf.Future[Outcome], candidate: Candidate) -> Outcome:
    try:
        return future.result()
    except (ConfigError, BrokenProcessPool):
        raise
    except Exception as error:  # a cluster's own: the worker was lost, the answer unreadable
        return _crashed(candidate, f"{type(error).__name__}: {error}")


def _crashed(candidate: Candidate, why: str) -> Outcome:
    return Outcome(candidate.x, candidate.level, candidate.seed, "crashed", why)


def local_processes(workers: int) -> MakeExecutor:
    """Local worker processes; they die with this process, however it dies."""

    def make() -> cf.Executor:
        return cf.ProcessPoolExecutor(
            workers,
            mp_context=multiprocessing.get_context("spawn"),
            initializer=_die_with,
            initargs=(os.getpid(),),
        )

    return make


def _die_with(parent: int) -> None:
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent decides what an interrupt means
    if os.getppid() != parent:
        os.kill(os.getpid(), signal.SIGKILL)


def dask_cluster(address: str) -> MakeExecutor:
    """Workers of the Dask scheduler at `address`, e.g. `tcp://10.0.0.1:8786`.

    Raises:
        ConfigError: if Dask is missing, or no scheduler answers.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise ConfigError("a scheduler needs Dask: pip install 'mfopt[cluster]'") from error

    def make() -> cf.Executor:
        try:
            return _Cluster(Client(address, timeout="10s"))  # type: ignore[no-untyped-call]
        except (OSError, ValueError) as error:
            raise ConfigError(f"no Dask scheduler answers at {address}: {error}") from error

    return make


class _Cluster(cf.Executor):
    """Dask's own executor, and the connection behind it, which that leaves open."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._executor: cf.Executor = client.get_executor(pure=False)

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> cf.Future[Any]:
        return self._executor.submit(fn, *args, **kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self._executor.shutdown(wait)
        self._client.close()


def one_thread() -> cf.Executor:
    """One thread of this process: for functions that cannot be pickled."""
    return cf.ThreadPoolExecutor(1)
