"""All runs and the report of one search, in one command; what is there is not run again.

python -m benchmarks.search.reproduce --search NAME [--reduced] [--jobs 2]
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.search import report, run
from benchmarks.search.suites import SUITES

ROOT = Path(__file__).parents[2]
FULL = ROOT / "benchmarks" / "search" / "results"
REDUCED = ROOT / "build" / "search-reduced"
LADDERS = ("ladder-stall", "ladder-shares", "ladder-short", "kendall-tau", "warm-start")
PEERS = {
    "noise-free": ("pycma", "lra", "lq"),
    "noisy": ("pycma", "lra", "noise-handler", "lq"),
    "ladder": ("pycma", "lra", *LADDERS),
    "bad": ("pycma", *LADDERS, "mfopt-target"),
}
REDUCED_CASES = {
    "noise-free": ("bbob/f8/d10", "bbob/f10/d13"),
    "noisy": ("noisy/f10-mul30/d13",),
    "ladder": ("ladder/f1/b1/n0", "ladder/f9/b1/n30"),
    "bad": ("bad/f1/useless",),
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what is missing on every suite, then report."""
    parser = argparse.ArgumentParser(prog="reproduce", description="a search and its peers")
    parser.add_argument("--search", required=True)
    parser.add_argument("--reduced", action="store_true", help="few cases, 3 instances")
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args(arguments)
    out = REDUCED if given.reduced else FULL
    for suite in SUITES:
        words = ["--suite", suite, "--peers", *PEERS[suite], given.search]
        words += ["--instances", "101-103" if given.reduced else "101-115"]
        words += ["--cases", *REDUCED_CASES[suite]] if given.reduced else []
        if failed := run.main([*words, "--out", str(out), "--jobs", str(given.jobs)]):
            return failed
    return report.main(["--search", given.search, "--in", str(out), "--out", str(out)])


if __name__ == "__main__":
    sys.exit(main())
