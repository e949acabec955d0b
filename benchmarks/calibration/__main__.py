"""All measurements of calibration, and what they found.

    python -m benchmarks.calibration             what is missing is measured, then all is printed
    python -m benchmarks.calibration --reduced   one known experiment from its first run, 10 min
    python -m benchmarks.calibration --report    print what was measured

All of it takes about 9 h of CPU and goes on where it stopped; `--work` is where the runs are kept.
"""

import argparse
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from benchmarks.calibration import drawn, peers, recovery, ridge
from benchmarks.calibration.experiments import CHANNELS, Experiment
from benchmarks.calibration.kept_runs import kept_runs

DRAWS = 20  # of the reduced form


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure and report, as the command line says."""
    parser = argparse.ArgumentParser(prog="benchmarks.calibration")
    form = parser.add_mutually_exclusive_group()
    form.add_argument("--reduced", action="store_true")
    form.add_argument("--report", action="store_true")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--work", type=Path, default=recovery.WORK)
    given = parser.parse_args(arguments)
    if given.reduced:
        with tempfile.TemporaryDirectory() as fresh:
            reduced(Path(fresh), given.jobs)
        return 0
    if not given.report:
        measure(given.work, given.jobs)
    for name, told in (
        ("Known experiments", recovery.report()),
        ("Drawn experiments", drawn.report()),
        ("A heap beside a discharge", ridge.report()),
        ("Peers", peers.report(peers.fits())),
    ):
        print("\n".join([f"# {name}", *told, ""]))
    return 0


def measure(work: Path, jobs: int) -> None:
    """Measure all that is missing."""
    where = ["--work", str(work), "--jobs", str(jobs)]
    recovery.main(["fit", *where])
    drawn.main(["fit", *where])
    ridge.main(where)
    peers.main(["fit", *where])


def reduced(work: Path, jobs: int) -> None:
    """Fit one known experiment, all runs anew, and some that are drawn from its emulators."""
    begun = time.monotonic()
    known = Experiment("recovery", 1)
    with kept_runs(work / "runs.jsonl", CHANNELS, jobs) as kept:
        line = recovery.fitted(known, recovery.RUNS, work, kept)
    print(recovery.shown(line))
    print(
        f"{line['new_runs']} runs in {time.monotonic() - begun:.0f} s on {jobs} cores, of which "
        f"{line['fit_cpu_s']:.0f} s of CPU are emulators and posterior"
    )
    found = work / "drawn.jsonl"
    drawn.draw(["1"], DRAWS, work, jobs, found)
    print("\n".join(drawn.report(found)))


if __name__ == "__main__":
    sys.exit(main())
