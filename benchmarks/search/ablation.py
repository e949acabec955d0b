"""What each part of the assisted search is worth: its cost against that of a variant.

    python -m benchmarks.search.ablation [--in benchmarks/search/results] [--jobs 1]

A variant lacks a part, or has one that the search does not have. The command runs what is missing
of six smooth cases, nine ladders and five noisy cases on instances 6-8. The rule for whole
generations was decided on these and on 9-11; no other part was tuned on them. Two columns compare:

- cost of the variant over cost of the search, to the same targets: a geometric mean over cases and
  targets, each ratio limited to 10; above 1 the search is cheaper;
- decades of the first gap that the search leaves more than the variant on the way, a mean over
  runs with its standard error; below 0 the search is better.

Other variants, measured on noisy ladders, whose ratio (above 1: the variant is cheaper) or decades
left (below 0: the variant is better) show no clear gain:

- a wider distribution, so that noise is half, one or two times the differences of candidates:
  0.99, 0.89, 0.87;
- the surrogate's minimiser is recommended: 0.43 (0.30 to 0.69);
- noise estimated from the nearest runs only: 1.11 (0.86 to 1.39);
- four validations without improvement instead of two: +0.02 ± 0.03; six: 1.09 (0.91 to 1.29);
- doubt about the next level's ranking does not move the search up: 0.88 (0.76 to 1.06);
- validations judged by posterior means: +0.04 ± 0.04;
- at least 15 % of the budget at each level: 0.77 (0.64 to 0.94);
- each run at the level where it settles most per cost: 0.97.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.search import run
from benchmarks.search.peers.ablations import ABLATIONS
from benchmarks.search.reproduce import FULL
from benchmarks.search.results import read_suite
from benchmarks.search.score import (
    compare,
    geometric_mean,
    interval,
    mean_and_error,
    paired,
    times,
)
from benchmarks.search.suites import TARGETS

WHOLE = "mfopt"
INSTANCES = "6-8"
CASES = {
    "noise-free": (
        "bbob/f1/d13", "bbob/f6/d13", "bbob/f8/d13", "bbob/f10/d13", "bbob/f13/d13", "bbob/f15/d13",
    ),
    "ladder": (
        "ladder/f1/b1/n0", "ladder/f6/b1/n0", "ladder/f10/b0.3/n0",
        "ladder/f9/b0.3/n5", "ladder/f10/b1/n5", "ladder/f15/b1/n5",
        "ladder/f6/b0.3/n30", "ladder/f9/b1/n30", "ladder/f13/b1/n30",
    ),
    "noisy": (
        "noisy/f1-mul30/d13", "noisy/f9-add5/d13", "noisy/f10-add5/d13",
        "noisy/f110/d13", "noisy/f116/d13",
    ),
}  # fmt: skip
VARIANTS = {
    "noise-free": ("mfopt-no-proposal", "mfopt-no-prescreening"),
    "ladder": tuple(ABLATIONS),
    "noisy": (
        "mfopt-no-proposal", "mfopt-no-prescreening", "mfopt-prescreening-under-noise",
        "mfopt-whole-under-noise", "mfopt-with-finalists",
    ),
}  # fmt: skip


def table(directory: Path) -> str:
    """The ratios as Markdown."""
    lines = ["| variant | suite | geometric mean | decades left | lost |", "|---|---|---|---|---|"]
    chosen = run.numbers([INSTANCES])
    for suite, cases in CASES.items():
        targets = TARGETS[suite]
        results = {
            name: [r for r in rows if r.case in cases and r.instance in chosen]
            for name, rows in read_suite(directory, "tuning", suite).items()
        }
        for name in VARIANTS[suite]:
            whole, variants = results[WHOLE], results[name]
            s = compare(whole, {name: variants}, targets, centre=geometric_mean)
            left = mean_and_error(paired(whole, variants))
            instances = max(r.instances for r in s.ratios)
            variant = name.removeprefix("mfopt-").replace("-", " ")
            lines.append(
                f"| {variant} | {suite} | {times(s.centre)}{interval(s, instances)} "
                f"| {left} | {len(s.lost)} of {len(s.ratios)} |"
            )
    return "\n".join(lines)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what is missing, then print the table."""
    parser = argparse.ArgumentParser(prog="ablation", description=__doc__)
    parser.add_argument("--in", dest="directory", type=Path, default=FULL)
    parser.add_argument("--jobs", type=int, default=1)
    given = parser.parse_args(arguments)
    for suite, cases in CASES.items():
        words = ["--suite", suite, "--peers", WHOLE, *VARIANTS[suite], "--instances", INSTANCES]
        words += ["--cases", *cases, "--out", str(given.directory), "--jobs", str(given.jobs)]
        if failed := run.main(words):
            return failed
    print(table(given.directory))
    return 0


if __name__ == "__main__":
    sys.exit(main())
