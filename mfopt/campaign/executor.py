"""Where runs are made: here, in local processes, or on a Dask cluster; one seam for all.

Everything goes through `concurrent.futures.Executor`. A worker process that dies takes
its pool with it; the pool is made anew and what was lost is run once more. A run that kills
its worker a second time, alone, is recorded as crashed. Where no worker can start, or a cluster
is lost, the study ends: no run is to blame.
"""

import concurrent.futures as cf
import pickle
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from typing import Any

from mfopt.campaign.local_workers import LocalPool
from mfopt.errors import ConfigError, SimulationError
from mfopt.files.scratch import temporary_directory
from mfopt.files.whole import full_disk_named
from mfopt.records.evaluation import Candidate
from mfopt.records.level import Ladder, Level
from mfopt.records.outcome import Outcome, checked, plain

MakeExecutor = Callable[[], cf.Executor]
TO_BE_LOADED = (
    "define the function with `def` at the top of a module (a .py file), not as a lambda, inside "
    "another function or at a prompt; or use workers = 1"
)


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
    _failed_starts: int = 0  # pools in a row of which no worker started

    def check(self, ladder: Ladder) -> None:
        """See that worker processes start and can load the levels, before anything is run.

        Raises:
            ConfigError: if a level cannot be sent to a worker, or not be loaded there.
            SimulationError: if no worker can start.
        """
        try:
            for level in ladder:
                if (why := self._why_not_loaded(level)) is not None:
                    raise ConfigError(
                        f"level {level.name!r} cannot be loaded by a worker process ({why}); "
                        f"{TO_BE_LOADED}"
                    )
        except BaseException:
            self.close()
            raise

    def _why_not_loaded(self, level: Level) -> str | None:
        try:
            text = pickle.dumps(level)
        except Exception as error:
            return plain(f"{type(error).__name__}: {error}")
        for _ in range(2):  # a process that somebody killed is no reason yet
            self._executor = self._executor or self.make()
            try:
                return self._executor.submit(_loading_fails, text).result()
            except BrokenProcessPool:
                self._raise_if_none_starts()
                self.close()
        return "the process died of it"

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
                self._raise_if_none_starts()
                if len(self._running) == 1 and job.deaths > 1:
                    self.close()
                    why = "the worker process died again and again while running this design"
                    return job.candidate, _crashed(job.candidate, why)
                self._start_again()
                continue
            del self._running[future]
            self._failed_starts = 0
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
            self._executor.shutdown(cancel_futures=True)
            self._executor = None

    def _start(self, job: _Job) -> None:
        self._executor = self._executor or self.make()
        try:
            future = self._executor.submit(evaluate, job.level, job.candidate.x, job.candidate.seed)
        except BrokenProcessPool:
            self._raise_if_none_starts()
            self._start_again(job)
        else:
            self._running[future] = job

    def _raise_if_none_starts(self) -> None:
        """The pool is broken: if no worker of it could start, nor of the one before, none will."""
        if isinstance(self._executor, LocalPool):
            error = self._executor.why_not_started()
            self._failed_starts = 0 if error is None else self._failed_starts + 1
            if isinstance(error, ConfigError) or (error is not None and self._failed_starts > 1):
                raise error from None

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
    """Evaluate in a worker; whatever a level raises is a crashed run.

    Raises:
        ConfigError: if no level could run here: a missing program, a full disk.
    """
    try:
        with full_disk_named(temporary_directory()):
            return checked(level.evaluate(x, seed=seed), x, level.name, seed)
    except ConfigError:
        raise
    except BaseException as error:  # SystemExit too: it would end this process
        if isinstance(error, KeyboardInterrupt) and _interruptible():
            raise
        why = plain(f"{type(error).__name__}: {error}")
        return Outcome(x, level.name, seed, "crashed", why)


def _interruptible() -> bool:
    """Whether a Ctrl-C at the terminal raises its exception here."""
    here = threading.current_thread() is threading.main_thread()
    return here and signal.getsignal(signal.SIGINT) is signal.default_int_handler


def _loading_fails(text: bytes) -> str | None:
    """In a worker: why this level cannot be loaded, or None. It comes from this same program."""
    try:
        pickle.loads(text)
    except BaseException as error:
        return plain(f"{type(error).__name__}: {error}")
    return None


def _result(future: cf.Future[Outcome], candidate: Candidate) -> Outcome:
    try:
        return future.result()
    except (ConfigError, SimulationError, BrokenProcessPool):
        raise
    except Exception as error:  # a cluster's own: the worker was lost, the answer unreadable
        return _crashed(candidate, plain(f"{type(error).__name__}: {error}"))


def _crashed(candidate: Candidate, why: str) -> Outcome:
    return Outcome(candidate.x, candidate.level, candidate.seed, "crashed", why)


def one_thread() -> cf.Executor:
    """One thread of this process: for functions that cannot be pickled."""
    return cf.ThreadPoolExecutor(1)
