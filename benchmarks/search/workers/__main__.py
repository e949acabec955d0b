"""Run one method on one case: task as JSON on the input, trace as the last line of the output."""

import json
import sys
from dataclasses import asdict
from importlib import import_module

from benchmarks.search.case import spend
from benchmarks.search.suites import case_named

LIMIT_S = 600.0  # processor time of the method itself on one run
MODULES = {"smac": "smac_worker", "dehb": "dehb_worker", "smt-mfk": "smt_worker",
           "botorch-mfkg": "botorch_worker"}  # fmt: skip


def main() -> None:
    """Read the task, run, write the trace."""
    name = sys.argv[1]
    task = json.load(sys.stdin)
    method = import_module(f"benchmarks.search.workers.{MODULES[name]}").method
    case = case_named(task["case"], task["instance"])
    seed = task["seed"]
    trace = spend(case, task["budget"], seed, lambda meter: method(meter, seed), limit_s=LIMIT_S)
    print()
    print(json.dumps(asdict(trace)))


main()
