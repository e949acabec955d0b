"""A Dask cluster whose scheduler is killed: nothing becomes an outcome, and nothing waits."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from fidelity.programs.function import FunctionLevel
from mfopt.arrays import Array
from mfopt.campaign.cluster import dask_cluster
from mfopt.campaign.executor import MakeExecutor, Runner, one_thread
from mfopt.campaign.run import run_study
from mfopt.campaign.store import create, open_run
from mfopt.errors import SimulationError
from mfopt.records.evaluation import Candidate
from mfopt.records.level import Ladder
from mfopt.records.problem import Problem, Variable
from mfopt.search.cmaes import CmaEs
from mfopt.search.search import Stage

pytest.importorskip("distributed", reason="needs the extra `cluster`")

AT_ONCE_S = 10.0  # [s] for what takes two seconds on a machine that is not stuck

CLUSTER = """
import sys
from distributed import LocalCluster
if __name__ == "__main__":
    cluster = LocalCluster(n_workers=1, threads_per_worker=2, dashboard_address=None)
    print(cluster.scheduler_address, flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, int]]:
    """Address and process id of a scheduler."""
    script = tmp_path / "cluster.py"
    script.write_text(CLUSTER, encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    with subprocess.Popen(
        [sys.executable, str(script)], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL, text=True, env=environment, start_new_session=True,
    ) as process:  # fmt: skip
        assert process.stdout is not None
        yield process.stdout.readline().strip(), process.pid
        os.killpg(process.pid, signal.SIGKILL)


@dataclass(frozen=True)
class Square:
    """Takes its time from the eighth call on, if it is told where to count them."""

    count: Path | None = None

    def __call__(self, x: Array, seed: int) -> float:
        if self.count is not None:
            (self.count / repr(x[0])).touch()
            if len(list(self.count.iterdir())) > 8:
                time.sleep(600.0)
        return float(x[0] ** 2)


def search(path: Path, make: MakeExecutor, function: Square) -> list[float]:
    """Start or resume a small search; the objectives of all its runs."""
    problem = Problem((Variable("a", -1.0, 1.0), Variable("b", -1.0, 1.0)), np.full(2, 0.8))
    ladder = Ladder((FunctionLevel("fine", function),))
    if not path.exists():
        create(path, "", {})
    run_study(
        problem, ladder,
        lambda _: CmaEs(problem, [Stage("fine", 5, 6, objective="returned")], seed=1),
        Runner(make), open_run(path), confirm_on=ladder, confirm_seeds=0, window=3,
    )  # fmt: skip
    return [e.objective for e in open_run(path).evaluations()]


@pytest.mark.filterwarnings("ignore")  # Dask's own
def test_a_killed_scheduler_ends_the_study_at_once_and_resuming_makes_the_lost_runs(
    cluster: tuple[str, int], tmp_path: Path
) -> None:
    address, pid = cluster
    counted = tmp_path / "counted"
    counted.mkdir()
    killed_at = []

    def kill_soon() -> None:
        while len(list(counted.iterdir())) <= 8:
            time.sleep(0.01)
        time.sleep(0.5)
        os.kill(pid, signal.SIGKILL)
        killed_at.append(time.monotonic())

    killer = threading.Thread(target=kill_soon)
    killer.start()
    with pytest.raises(SimulationError, match=f"{address} is gone.*--resume"):
        search(tmp_path / "run", dask_cluster(address), Square(counted))
    assert time.monotonic() - killed_at[0] < AT_ONCE_S
    killer.join()
    stored = list(open_run(tmp_path / "run").evaluations())
    assert len(stored) >= 6
    assert all(e.outcome.finished for e in stored)
    resumed = search(tmp_path / "run", one_thread, Square())
    assert resumed == search(tmp_path / "undisturbed", one_thread, Square())


@pytest.mark.filterwarnings("ignore")  # Dask's own
def test_nothing_can_be_started_on_a_scheduler_that_is_gone(cluster: tuple[str, int]) -> None:
    address, pid = cluster
    runner, ladder = Runner(dask_cluster(address)), Ladder((FunctionLevel("fine", Square()),))
    runner.submit(ladder, Candidate(0, np.ones(1), "fine", 1))
    assert runner.next()[1].finished
    os.kill(pid, signal.SIGKILL)
    with pytest.raises(SimulationError, match="is gone"):
        run_on(runner, ladder)
    began = time.monotonic()
    runner.close()
    assert time.monotonic() - began < AT_ONCE_S


def run_on(runner: Runner, ladder: Ladder) -> None:
    for index in range(1, 1000):
        runner.submit(ladder, Candidate(index, np.ones(1), "fine", 1))
        runner.next()
