"""Does the usual step of `numba` stay right where grains bounce little?

    python -m benchmarks.engine.step [--restitutions 0.1 0.2 0.3 0.4 0.5 0.7] [--seeds 8]

1 800 spheres with friction 0.5 and body damping 0.35 leave the slot of 30 mm of the rig of
calibration. For each restitution and step it prints the discharged fraction at half of the time and
at the end, in per cent of that with the step 0.6, with the standard error over the packings.
"""

import argparse
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context

import numpy as np

from benchmarks.calibration.experiments import STATED, rig
from mfopt.arrays import Array

RESTITUTIONS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.7)
RIGHT = 0.6
STEPS = (2.0, None, RIGHT)  # None: the usual step
PARAMETERS = ("friction", "restitution", "body_damping")
FRICTION, DAMPING = 0.5, 0.35
FIRST_SEED = 900


@dataclass(frozen=True, slots=True)
class Asked:
    """One run."""

    restitution: float
    step: float | None
    seed: int


def main(arguments: Sequence[str] | None = None) -> int:
    """Run, and print the table."""
    parser = argparse.ArgumentParser(prog="step", description="steps of numba at low restitution")
    parser.add_argument("--restitutions", nargs="*", type=float, default=RESTITUTIONS)
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args(arguments)
    with ProcessPoolExecutor(given.jobs, mp_context=get_context("spawn")) as pool:
        for restitution in given.restitutions:
            asked = [
                Asked(restitution, step, FIRST_SEED + n)
                for step in STEPS
                for n in range(given.seeds)
            ]
            found = np.array(list(pool.map(fractions, asked)))
            print(told(restitution, found.reshape(len(STEPS), given.seeds, 2)), flush=True)
    return 0


def fractions(asked: Asked) -> Array:
    """Discharged fraction (2,) at half of the time and at the end."""
    own = {} if asked.step is None else {"timestep_factor": asked.step}
    hopper = rig("numba", young_modulus_pa=STATED, **own)
    level = hopper.level("slot", {"opening_mm": 30.0}, PARAMETERS)
    x = np.array([FRICTION, asked.restitution, DAMPING])
    over_time = level.evaluate(x, seed=asked.seed).raw["discharged_fraction"]
    return np.array([over_time[len(over_time) // 2], over_time[-1]])


def told(restitution: float, found: Array) -> str:
    """One line from fractions (steps, seeds, 2)."""
    mean, variance = found.mean(axis=1), found.var(axis=1, ddof=1) / found.shape[1]
    cells = []
    for step, its, spread in zip(STEPS, mean, variance, strict=True):
        if step == RIGHT:
            continue
        less = 100.0 * (its / mean[-1] - 1.0)
        sd = 100.0 * np.sqrt(spread + variance[-1]) / mean[-1]
        both = ", ".join(f"{v:+.1f} ± {e:.1f} %" for v, e in zip(less, sd, strict=True))
        cells.append(f"{'usual' if step is None else f'{step:g}'}: {both}")
    return f"restitution {restitution:g}   " + "   ".join(cells)


if __name__ == "__main__":
    sys.exit(main())
