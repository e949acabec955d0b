"""Run methods on the cases of a suite; what is in the directory already is not run again.

    python -m benchmarks.search.run --suite noisy --peers pycma lra --instances 101-115
        --out benchmarks/search/results [--cases 'noisy/f10*'] [--jobs 2] [--budget 1]

The seed of a run is its instance. The budget is `suites.default_budget` times a factor, `--budget`
or the method's own in `BUDGET_FACTORS`: a method that needs long is given long, so that its
cost to a target is measured instead of guessed from its failures.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from fnmatch import fnmatch
from multiprocessing import get_context
from pathlib import Path

from benchmarks.search.peers import PEERS
from benchmarks.search.results import Result, append, done, kind_of, read, result_file, scored
from benchmarks.search.score import share
from benchmarks.search.suites import SUITES, TARGETS, case_named, default_budget

BUDGET_FACTORS = {  # by suite, then by peer
    "noise-free": {"pycma": 4.0, "lra": 4.0},
    "noisy": {},
    "ladder": {"pycma": 15.0, "lra": 15.0, "warm-start": 4.0, "ladder-stall": 4.0,
               "kendall-tau": 4.0},
    "bad": {"pycma": 3.0},
}  # fmt: skip

Task = tuple[str, str, str, int, float]  # suite, peer, case, instance, budget


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what is missing."""
    given = _parser().parse_args(arguments)
    try:
        tasks = list(_tasks(given))
    except ValueError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    print(f"{len(tasks)} runs to do")
    for number, (task, result) in enumerate(_run_all(tasks, given.jobs), start=1):
        suite, peer, case, instance, _ = task
        append(result_file(given.out, suite, peer, instance), result)
        reached = ", ".join(map(share, result.hits)) or "no target"
        print(f"{number}/{len(tasks)} {peer} {case} {instance}: reached {reached}; "
              f"cost {result.cost:g}, {result.cpu_s:.1f} s", flush=True)  # fmt: skip
    return 0


def run_one(task: Task) -> Result:
    """Run one method on one instance."""
    suite, peer, name, instance, budget = task
    trace = PEERS[peer](case_named(name, instance), budget, instance)
    return scored(peer, name, instance, budget, trace, TARGETS[suite])


def numbers(words: Sequence[str]) -> list[int]:
    """Read numbers and ranges such as `1-5`."""
    found: list[int] = []
    for word in words:
        first, _, last = word.partition("-")
        found += range(int(first), int(last or first) + 1)
    return found


def _tasks(given: argparse.Namespace) -> Iterator[Task]:
    instances = numbers(given.instances)
    if len({kind_of(i) for i in instances}) > 1:
        raise ValueError("tuning and reported instances are not run together")
    for peer in given.peers:
        path = result_file(given.out, given.suite, peer, instances[0])
        there = done(read(path))
        factor = given.budget or BUDGET_FACTORS[given.suite].get(peer, 1.0)
        for instance in instances:
            for name in SUITES[given.suite]:
                if given.cases and not any(fnmatch(name, pattern) for pattern in given.cases):
                    continue
                budget = factor * default_budget(case_named(name, instance))
                if (name, instance, budget) not in there:
                    yield given.suite, peer, name, instance, budget


def _run_all(tasks: list[Task], jobs: int) -> Iterator[tuple[Task, Result]]:
    if jobs == 1:
        for task in tasks:
            yield task, run_one(task)
        return
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        waiting = {pool.submit(run_one, task): task for task in tasks}
        for future in as_completed(waiting):
            yield waiting[future], future.result()


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="run", description="run searches on a suite")
    parser.add_argument("--suite", choices=sorted(SUITES), required=True)
    parser.add_argument("--peers", nargs="+", choices=sorted(PEERS), required=True)
    parser.add_argument("--instances", nargs="+", required=True, help="such as 101-115")
    parser.add_argument("--cases", nargs="+", help="patterns such as 'bbob/f10/*'")
    parser.add_argument("--budget", type=float, help="in default budgets")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--jobs", type=int, default=1)
    return parser


if __name__ == "__main__":
    sys.exit(main())
