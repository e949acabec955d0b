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
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from mfopt.errors import ConfigError
from mfopt.evaluation import Candidate
from mfopt.files import full_disk_named
from mfopt.level import Ladder, Level
from mfopt.outcome import Outcome

MakeExecutor = Callable[[], cf.Executor]
PR_SET_PDEATHSIG = 1  # prctl(2)


@dataclass(slots=True)
class _Job:
    """One run, and how often a worker died under it."""

    candidate: Candidate
    level: Level
    deaths: int = 0


@dataclass(slots=True)
class Runner:
    """Makes runs through an executor, which it makes anew if it breaks."""

    make: MakeExecutor
    _executor: cf.Executor | None = None
    _running: dict[cf.Future[Outcome], _Job] = field(default_factory=dict)
    _suspects: list[_Job] = field(default_factory=list)  # died twice in company: alone next

    def submit(self, ladder: Ladder, candidate: Candidate) -> None:
        """Start a run, or queue it behind those that are running."""
        self._start(_Job(candidate, ladder[candidate.level]))

    def next(self) -> tuple[Candidate, Outcome]:
        """Wait for the run that ends first; of several that have ended, the first submitted."""
        while True:
            if not self._running:
                self._start(self._suspects.pop(0))
            ended = cf.wait(list(self._running), return_when=cf.FIRST_COMPLETED).done
            future = next(f for f in self._running if f in ended)
            job = self._running[future]
            try:
                outcome = _result(future, job.candidate)
            except BrokenProcessPool:
                if len(self._running) == 1 and job.deaths > 1:
                    self.close()
                    why = "the worker process died again and again while running this design"
                    return job.candidate, _crashed(job.candidate, why)
                self._start_again()
                continue
            del self._running[future]
            return job.candidate, outcome

    def run(
        self, ladder: Ladder, candidates: Sequence[Candidate]
    ) -> Iterator[tuple[Candidate, Outcome]]:
        """Evaluate the candidates; yield each as it ends."""
        for candidate in candidates:
            self.submit(ladder, candidate)
        for _ in candidates:
            yield self.next()

    def close(self) -> None:
        """End the workers, and at once what they are running."""
        self._running = {}
        if self._executor is not None:
            # Python 3.14 calls this `kill_workers`; other executors have no processes here.
            for worker in list((getattr(self._executor, "_processes", None) or {}).values()):
                worker.kill()
            self._executor.shutdown(cancel_futures=True)
            self._executor = None

    def _start(self, job: _Job) -> None:
        self._executor = self._executor or self.make()
        try:
            future = self._executor.submit(evaluate, job.level, job.candidate.x, job.candidate.seed)
        except BrokenProcessPool:
            self._start_again(job)
        else:
            self._running[future] = job

    def _start_again(self, also: _Job | None = None) -> None:
        """A worker died and took all with it: once more together, then one by one."""
        lost = sorted(self._running.values(), key=lambda job: job.candidate.index)
        self.close()
        for job in lost:
            job.deaths += 1
        again = [job for job in lost if job.deaths < 2]
        self._suspects += [job for job in lost if job.deaths >= 2]
        for job in [*again, *([] if also is None else [also])]:
            self._start(job)


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
