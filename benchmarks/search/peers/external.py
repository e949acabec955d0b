"""Peers that run in environments of their own (`benchmarks/search/environments` makes them)."""

import json
import subprocess
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from benchmarks.search.case import Case, Trace

ROOT = Path(__file__).parents[3]
ENVIRONMENTS = {"smac": "smac", "dehb": "dehb", "smt-mfk": "smt", "botorch-mfkg": "botorch"}


def run_worker(name: str, case: Case, budget: float, seed: int) -> Trace:
    """Run a worker on a case in its own environment.

    Raises:
        FileNotFoundError: if the environment is not there.
        subprocess.CalledProcessError: if the worker failed; its message is on the error stream.
    """
    environment = ENVIRONMENTS[name]
    python = ROOT / "build" / "peers" / environment / "bin" / "python"
    if not python.exists():
        raise FileNotFoundError(
            f"{name} needs {python}; make it with benchmarks/search/environments {environment}"
        )
    task = {"case": case.name, "instance": case.instance, "budget": budget, "seed": seed}
    done = subprocess.run(
        [python, "-m", "benchmarks.search.workers", name],
        input=json.dumps(task), stdout=subprocess.PIPE, text=True, cwd=ROOT, check=True,
    )  # fmt: skip
    row = json.loads(done.stdout.splitlines()[-1])
    return Trace(
        tuple(row["costs"]), tuple(row["cells"]), tuple(row["levels"]), tuple(row["runs"]),
        row["cost"], row["cpu_s"], row["slowest_s"], row["why"],
    )  # fmt: skip


EXTERNAL: Mapping[str, Callable[[Case, float, int], Trace]] = {
    name: partial(run_worker, name) for name in ENVIRONMENTS
}
