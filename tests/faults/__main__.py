"""`python -m faults`: inject faults and print what was tried, what survived, what was lost."""

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

from faults.plans import LONG, SHORT, trials
from faults.table import Trial, losses, table


def main() -> int:
    """Try the kinds asked for; 1 if anything was lost."""
    parser = argparse.ArgumentParser("scripts/survive", description=__doc__)
    parser.add_argument("--long", action="store_true", help="hundreds of each (hours), not a few")
    parser.add_argument("--kind", action="append", choices=list(LONG), help="only this; repeatable")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first trial of a kind")
    parser.add_argument("--count", type=int, help="trials of each kind")
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)))
    given = parser.parse_args()
    made: list[Trial] = []
    began = time.monotonic()
    folder = Path(tempfile.mkdtemp(prefix="survive-"))
    print(f"seed {given.seed}; what was lost is kept in {folder}", flush=True)
    for kind in given.kind or LONG:
        numbers = (LONG if given.long else SHORT)[kind]
        if given.count is not None:
            numbers = range(given.first, given.first + given.count)
        for trial in trials(kind, folder, given.seed, numbers, given.jobs):
            made.append(trial)
            print("\n".join(losses([trial])) or ".", end="" if trial.loss is None else "\n",
                  flush=True)  # fmt: skip
    print(f"\n\n{table(made)}\n{(time.monotonic() - began) / 60.0:.1f} min", flush=True)
    return int(any(trial.loss is not None for trial in made))


if __name__ == "__main__":
    sys.exit(main())
