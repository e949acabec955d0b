import errno
import os
import signal
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from mfopt.arrays import Array
from mfopt.errors import ConfigError
from mfopt.evaluation import Candidate
from mfopt.executor import MakeExecutor, Runner, dask_cluster, local_processes, one_thread
from mfopt.level import Ladder
from mfopt.outcome import Outcome


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


def test_a_full_disk_stops_the_study_instead_of_failing_its_runs(tmp_path: Path) -> None:
    runner = Runner(local_processes(1))
    with pytest.raises(ConfigError, match="no disk space left"):
        list(runner.run(Ladder((Lethal(tmp_path, 0),)), candidates(1.0, 2000.0)))
    runner.close()


def test_missing_scheduler_is_named() -> None:
    pytest.importorskip("distributed", reason="needs the extra `cluster`")
    with pytest.raises(ConfigError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9"):
        dask_cluster("tcp://127.0.0.1:9")()
