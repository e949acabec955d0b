import errno
import os
import signal
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from mfopt.arrays import Array
from mfopt.campaign.cluster import dask_cluster
from mfopt.campaign.executor import MakeExecutor, Runner, evaluate, one_thread
from mfopt.campaign.local_workers import LocalPool, local_processes
from mfopt.errors import ConfigError
from mfopt.records.evaluation import Candidate
from mfopt.records.level import Ladder
from mfopt.records.outcome import Outcome


@dataclass(frozen=True)
class Lethal:
    """Kills its worker for x[0] < 0: the first `deaths` times, counted in a directory."""

    directory: Path
    deaths: int
    name: str = "lethal"

    def work(self, x: Array) -> float:
        return 1.0

    def evaluate(self, x: Array, *, seed: int) -> Outcome:
        if x[0] < 0:
            died = len(list(self.directory.iterdir()))
            if died < self.deaths:
                (self.directory / str(died)).touch()
                os.kill(os.getpid(), signal.SIGKILL)
        if x[0] > 1000:
            raise OSError(errno.ENOSPC, "No space left on device")
        if x[0] > 100:
            raise ZeroDivisionError("x is large")
        return Outcome(x, self.name, seed, "finished", raw={"f": np.asarray(x[0] ** 2)})


def candidates(*values: float) -> list[Candidate]:
    return [Candidate(i, np.array([v]), "lethal", 1) for i, v in enumerate(values)]


@pytest.fixture(scope="module")
def dask_address() -> Iterator[str]:
    distributed = pytest.importorskip("distributed", reason="needs the extra `cluster`")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
    ) as cluster:
        yield cluster.scheduler_address


@pytest.mark.filterwarnings("ignore")  # Dask's own, at shutdown
@pytest.mark.parametrize("where", ["one thread", "local processes", "dask"])
def test_every_executor_gives_the_same_outcomes(
    where: str, tmp_path: Path, request: pytest.FixtureRequest
) -> None:
    make: MakeExecutor = one_thread
    if where == "local processes":
        make = local_processes(2)
    if where == "dask":
        make = dask_cluster(request.getfixturevalue("dask_address"))
    runner = Runner(make)
    ladder = Ladder((Lethal(tmp_path, 0),))
    done = {c.index: o for c, o in runner.run(ladder, candidates(1.0, 200.0, 3.0))}
    runner.close()
    assert done[0].raw["f"] == 1.0
    assert (done[1].status, done[1].why) == ("crashed", "ZeroDivisionError: x is large")
    assert done[2].raw["f"] == 9.0


@pytest.mark.parametrize(("deaths", "status"), [(1, "finished"), (99, "crashed")])
def test_a_worker_that_dies_is_replaced_and_the_run_tried_again(
    deaths: int, status: str, tmp_path: Path
) -> None:
    runner = Runner(local_processes(2))
    ladder = Ladder((Lethal(tmp_path, deaths),))
    done = {c.index: o for c, o in runner.run(ladder, candidates(1.0, 2.0, -3.0, 4.0))}
    runner.close()
    assert sorted(done) == [0, 1, 2, 3]
    assert done[2].status == status
    assert all(done[i].finished for i in (0, 1, 3))


def test_a_worker_that_dies_while_another_one_starts_is_replaced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    start_one, late = LocalPool._spawn_process, []

    def start_late(pool: LocalPool) -> None:
        if pool._processes and not late:
            late.append(pool)
            while not pool._call_queue._reader.closed:  # until the pool has noticed the death
                time.sleep(0.01)
        start_one(pool)

    monkeypatch.setattr(LocalPool, "_spawn_process", start_late)
    ladder, runner = Ladder((Lethal(tmp_path, 1),)), Runner(local_processes(2))
    done = {c.index: o for c, o in runner.run(ladder, candidates(-1.0, 2.0))}
    runner.close()
    assert late
    assert all(outcome.finished for outcome in done.values())


def test_a_full_disk_stops_the_study_instead_of_failing_its_runs(tmp_path: Path) -> None:
    runner = Runner(local_processes(1))
    with pytest.raises(ConfigError, match="no disk space left"):
        list(runner.run(Ladder((Lethal(tmp_path, 0),)), candidates(1.0, 2000.0)))
    runner.close()


def test_missing_scheduler_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed", reason="needs the extra `cluster`")
    monkeypatch.setattr("mfopt.campaign.cluster.CONNECT_S", 0.5)
    with pytest.raises(ConfigError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9"):
        dask_cluster("tcp://127.0.0.1:9")()


@dataclass(frozen=True)
class Raises:
    """A level that raises what it is given, or returns it."""

    it: object
    name: str = "lethal"

    def work(self, x: Array) -> float:
        return 1.0

    def evaluate(self, x: Array, *, seed: int) -> Outcome:
        if isinstance(self.it, BaseException):
            raise self.it
        return cast(Outcome, self.it)


@pytest.mark.parametrize("error", [SystemExit(0), KeyboardInterrupt(), GeneratorExit()])
@pytest.mark.parametrize("make", [one_thread, local_processes(1)], ids=["thread", "process"])
def test_whatever_a_level_raises_is_a_crashed_run(make: MakeExecutor, error: BaseException) -> None:
    runner = Runner(make)
    done = [o for _, o in runner.run(Ladder((Raises(error),)), candidates(1.0, 2.0))]
    runner.close()
    assert [o.status for o in done] == ["crashed", "crashed"]
    assert type(error).__name__ in str(done[0].why)


def test_an_interrupt_at_the_terminal_still_interrupts() -> None:
    with pytest.raises(KeyboardInterrupt):
        evaluate(Raises(KeyboardInterrupt()), np.zeros(1), 1)


def outcome(**its: Any) -> Outcome:
    return Outcome(np.zeros(1), "lethal", 1, **({"status": "finished"} | its))


@pytest.mark.parametrize(
    ("returned", "words"),
    [
        (None, "NoneType"),
        (outcome(status="fine"), "'fine'"),
        (outcome(raw={"a/b": np.zeros(1)}), "a/b"),
        (outcome(raw={"\ud800": np.zeros(1)}), "letters"),
        (outcome(raw={"f": "0.5"}), "no numbers"),
        (outcome(raw={"f": [[1], [2, 3]]}), "inhomogeneous"),
        (outcome(raw={"f": object()}), "no numbers"),
        (outcome(raw=None), "items"),
        (outcome(work=1e300), "1e+18"),
        (outcome(work=float("nan")), "work"),
        (outcome(work="much"), "much"),
        (outcome(cpu_s=-1.0), "cpu_s"),
    ],
)
def test_an_outcome_that_no_store_could_keep_is_a_crashed_run(returned: object, words: str) -> None:
    made = evaluate(Raises(returned), np.zeros(1), 1)
    assert made.status == "crashed"
    assert words in str(made.why)


def test_why_is_text_that_every_screen_and_file_can_show() -> None:
    made = evaluate(Raises(ValueError("\x1b[31mred\0 \ud800\tend" + 10**6 * "n")), np.zeros(1), 1)
    assert made.why is not None
    assert made.why.startswith("ValueError: \ufffd[31mred\ufffd \ufffd\tend")
    assert len(made.why) < 20_000


KILLED_AT_ITS_START = """
import os, signal, sys
told = {told!r}
if "--multiprocessing-fork" in sys.orig_argv and not os.path.exists(told):
    open(told, "w").close()
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.parametrize("checked", [True, False])
def test_a_worker_that_is_killed_while_it_starts_is_replaced(
    checked: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hook, told = tmp_path / "hook", tmp_path / "told"
    hook.mkdir()
    (hook / "sitecustomize.py").write_text(KILLED_AT_ITS_START.format(told=str(told)))
    monkeypatch.setenv("PYTHONPATH", str(hook), prepend=os.pathsep)
    (tmp_path / "deaths").mkdir()
    ladder, runner = Ladder((Lethal(tmp_path / "deaths", 0),)), Runner(local_processes(1))
    if checked:
        runner.check(ladder)
    done = {c.index: o for c, o in runner.run(ladder, candidates(1.0, 2.0))}
    runner.close()
    assert told.exists()
    assert all(outcome.finished for outcome in done.values())
