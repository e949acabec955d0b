"""Do the intervals hold the truth? On experiments drawn from the emulators of a finished run.

    python -m benchmarks.calibration.drawn CASE.toml --directory RUN --runs 100 --draws 100

RUN is the directory that `mfopt calibrate CASE.toml` filled with so many runs; no new run is made.
Each experiment has parameters drawn from the prior, packing noise, measurement noise, errors of
zero and clock, and the allowance, as large as the likelihood takes them to be. The intervals then
hold the truth as often as they say, unless the sampler or the likelihood errs.
"""

import argparse
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from calibration.campaign import calibrate
from calibration.likelihood import Likelihood, likelihood, with_scores
from calibration.posterior import prior_transform, sample, to_unit
from calibration.recordings.case import Parameter
from mfopt.arrays import Array
from mfopt.campaign.memory import Memory
from mfopt.campaign.store import open_run
from mfopt.errors import ConfigError
from mfopt.records.evaluation import Candidate, Evaluation
from mfopt.study.case import COMPARED, assemble_case

LEVELS = (0.5, 0.9)


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw experiments, fit them, and print how often the truth lies in the intervals."""
    parser = argparse.ArgumentParser(prog="drawn", description="coverage on drawn experiments")
    parser.add_argument("case", type=Path)
    parser.add_argument("--directory", type=Path, required=True)
    parser.add_argument("--runs", type=int, required=True)
    parser.add_argument("--draws", type=int, default=100)
    parser.add_argument("--jobs", type=int, default=2)
    given = parser.parse_args(arguments)
    parts = assemble_case(given.case)
    memory = Memory(open_run(given.directory, COMPARED))

    def stored(candidates: Sequence[Candidate]) -> list[Evaluation]:
        found = [memory.recall(c) for c in candidates]
        if None in found:
            raise ConfigError(f"{given.directory} lacks runs; finish it with mfopt calibrate")
        return [e for e in found if e is not None]

    fitted = calibrate(parts.case, parts.noises, stored, given.runs).fitted
    likely = likelihood(fitted.observations, fitted.emulators)
    tasks = [(likely, parts.case.parameters, seed) for seed in range(given.draws)]
    with ProcessPoolExecutor(given.jobs, mp_context=get_context("spawn")) as pool:
        ranks = np.array(list(pool.map(rank_of_truth, tasks)))  # (draws, d)
    for name, column in zip(parts.problem.names, ranks.T, strict=True):
        held = [np.mean(np.abs(column - 0.5) <= level / 2) for level in LEVELS]
        pairs = zip(LEVELS, held, strict=True)
        said = ", ".join(f"{level:.0%} interval: {h:.1%}" for level, h in pairs)
        print(f"{name}: {said}")
    pooled = np.mean(np.abs(ranks - 0.5) <= LEVELS[-1] / 2)
    print(f"pooled over {ranks.size}: {pooled:.1%} in the {LEVELS[-1]:.0%} interval")
    return 0


def rank_of_truth(task: tuple[Likelihood, tuple[Parameter, ...], int]) -> Array:
    """Share of the posterior (d,) below the truth of one drawn experiment."""
    likely, parameters, seed = task
    rng = np.random.default_rng(seed)
    z = prior_transform(parameters)(rng.random(len(parameters)))
    residual, covariance = likely.residual(z)
    own = likely.scores - residual  # the emulators' mean
    drawn = own + np.linalg.cholesky(covariance) @ rng.normal(size=len(own))
    posterior = sample(with_scores(likely, drawn), parameters, seed=seed)
    draws = to_unit(parameters, posterior.draws)
    return np.asarray((draws < z).mean(axis=0))


if __name__ == "__main__":
    sys.exit(main())
