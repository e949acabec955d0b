"""Processor time of one fit of the surrogate and of joint draws from it.

    python -m benchmarks.search.surrogate_time [--runs 400] [--dimension 13]

The first fit starts from defaults, a further one from what the last one found, as in a search. The
sum is that of a first fit and the draws.
"""

import argparse
import statistics
import sys
import time
from collections.abc import Sequence

import numpy as np

from mfopt.search.surrogate import Observations
from surrogates.autoregressive import AutoregressiveGp

CANDIDATES = 100
DRAWS = 128
REPEATS = 5
SHARES = (0.6, 0.3, 0.1)  # of the runs on three levels


def observations(runs: int, dimension: int, levels: int, seed: int) -> Observations:
    """Noisy runs of a bent valley, on one level or on three that are alike."""
    rng = np.random.default_rng(seed)
    z = rng.standard_normal((runs, dimension))
    level = rng.choice(levels, size=runs, p=SHARES if levels > 1 else [1.0])
    bent = z[:, 1:] - (0.3 + 0.1 * level[:, None]) * z[:, :-1] ** 2
    value = (z**2).sum(axis=1) + 10.0 * (bent**2).sum(axis=1)
    value *= 1.0 + 0.1 * rng.standard_normal(runs)
    return Observations(z, level, value, np.zeros((runs, 0)))


def measure(runs: int, dimension: int, levels: int, seed: int) -> tuple[float, float, float]:
    """Processor times [s] of the first fit, of a further one and of the draws."""
    made = observations(runs, dimension, levels, seed)
    rng = np.random.default_rng(seed)
    candidates = rng.standard_normal((CANDIDATES, dimension))
    began = time.process_time()
    posterior = AutoregressiveGp().fit(made)
    first = time.process_time()
    posterior = AutoregressiveGp().fit(made, start=posterior.hyperparameters)
    further = time.process_time()
    posterior.sample(candidates, levels - 1, DRAWS, rng)
    return first - began, further - first, time.process_time() - further


def main(arguments: Sequence[str] | None = None) -> int:
    """Print median and longest times."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.search.surrogate_time")
    parser.add_argument("--runs", type=int, default=400)
    parser.add_argument("--dimension", type=int, default=13)
    given = parser.parse_args(arguments)
    print(
        "| levels | first fit, s | further fit, s | joint draws, s | first fit + draws, longest |"
    )
    print("|---|---|---|---|---|")
    measure(given.runs, given.dimension, 1, 0)  # imports and first calls
    for levels in (1, 3):
        times = [measure(given.runs, given.dimension, levels, 1 + k) for k in range(REPEATS)]
        row = " | ".join(f"{statistics.median(column):.3f}" for column in zip(*times, strict=True))
        longest = max(first + draws for first, _, draws in times)
        print(f"| {levels} | {row} | {longest:.3f} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
