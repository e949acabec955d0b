"""The search's own processor time per ask and tell, by the number of runs it knows.

python -m benchmarks.search.own_time [--case noisy/f113/d13] [--runs 1000]
"""

import argparse
import sys
import time
from collections.abc import Iterator, Sequence

import numpy as np

from benchmarks.search.case import Case
from benchmarks.search.peers.ours import assisted
from benchmarks.search.suites import case_named

BLOCK = 100  # runs over which the times are summed up


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one search and print median, mean and longest time of its cycles, block by block."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.search.own_time")
    parser.add_argument("--case", default="noisy/f113/d13")
    parser.add_argument("--runs", type=int, default=1000)
    given = parser.parse_args(arguments)
    print("| runs known | median s | mean s | longest s | cycles |\n|---|---|---|---|---|")
    times: list[float] = []
    block = 1
    for known, seconds in _cycles(case_named(given.case, 1), given.runs):
        times.append(seconds)
        if known >= block * BLOCK:
            row = f"{np.median(times):.3f} | {np.mean(times):.3f} | {max(times):.3f}"
            print(f"| {known} | {row} | {len(times)} |", flush=True)
            times, block = [], block + 1
    return 0


def _cycles(case: Case, runs: int) -> Iterator[tuple[int, float]]:
    """Runs known and CPU seconds [s] of each ask and tell, one run at a time."""
    search = assisted(case, float(runs), 1)
    rng = np.random.default_rng(1)
    known = 0
    while search.should_stop() is None:
        began = time.process_time()
        (candidate,) = search.ask(1)
        asked_s = time.process_time() - began
        value = case.evaluate(candidate.x, int(candidate.level), rng)
        began = time.process_time()
        search.tell([candidate], [value])
        known += 1
        yield known, asked_s + time.process_time() - began


if __name__ == "__main__":
    sys.exit(main())
