"""Fit real recordings and print a table.

    MFOPT_RECORDINGS=FOLDER python -m benchmarks.calibration.real balls|pendulum|hopper --work DIR

The recordings are no part of this repository. Each case file, its runs and its result are kept in
DIR; a case that has a result is not fitted again.
"""

import sys
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from benchmarks.calibration.real import balls, hopper, pendulum
from benchmarks.calibration.real.kept import chosen, result

CASES = {"balls": balls.cases, "pendulum": pendulum.cases, "hopper": hopper.cases}


def main(arguments: Sequence[str] | None = None) -> int:
    """Fit all cases, or those that are named."""
    asked = list(chosen("calibrations to real recordings", CASES, arguments))
    print("| case | parameter: 90 % interval | misfit | fitted | held out |\n|---|---|---|---|---|")
    for case, work in asked:
        found = result(case, work / case.name, "calibrate", "calibration.json")
        print(line(case.name, found), flush=True)
    return 0


def line(name: str, its: dict[str, Any]) -> str:
    """A row of the table; errors are rms, and in multiples of what all known errors explain."""
    values = "; ".join(
        f"{p['name']}: {p['interval'][0]:.4g} to {p['interval'][1]:.4g}"
        + ("" if p["determined"] else " (not determined)")
        for p in its["parameters"]
    )
    misfit = f"{its['misfit']:.0f} on {its['freedom']}"
    used = (", ".join(errors(its, held_out=held)) for held in (False, True))
    return f"| {name} | {values} | {misfit} | {' | '.join(used)} |"


def errors(its: dict[str, Any], *, held_out: bool) -> Iterator[str]:
    """The largest error of the recordings that were fitted or held out, and the median."""
    those = [c for c in its["compared"] if c["held_out"] is held_out]
    if not those:
        return
    rms = [float(np.sqrt(np.mean(np.subtract(c["recorded"], c["simulated"]) ** 2))) for c in those]
    ratios = [c["error"] for c in those]
    yield f"{np.median(rms):.2g} {those[0]['unit']}, {np.median(ratios):.2f} times"
    if len(those) > 1:
        yield f"at most {max(rms):.2g} {those[0]['unit']}, {max(ratios):.2f} times"


if __name__ == "__main__":
    sys.exit(main())
