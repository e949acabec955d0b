"""Do the intervals hold the truth? On experiments drawn from the emulators of fitted ones.

    python -m benchmarks.calibration.drawn fit [--experiments 1-5] [--draws 100]
    python -m benchmarks.calibration.drawn report

Each fit of a known experiment (`benchmarks.calibration.recovery`) gives emulators and a likelihood.
From these, experiments are drawn: parameters from the prior, packing noise, measurement noise,
errors of zero and clock, and the allowance, as large as the likelihood takes them to be. The
intervals then hold the truth as often as they say, unless the sampler or the likelihood errs. What
was drawn once is not drawn again.
"""

import argparse
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from benchmarks import lines
from benchmarks.calibration.experiments import CHANNELS, chosen
from benchmarks.calibration.kept_runs import kept_runs
from benchmarks.calibration.recovery import RUNS, WORK, fit_of
from calibration.likelihood import Likelihood, likelihood, with_scores
from calibration.posterior import LEVEL, prior_transform, sample, to_unit
from calibration.recordings.case import Parameter
from mfopt.arrays import Array

FOUND = Path(__file__).parent / "results" / "drawn.jsonl"
LEVELS = (0.5, LEVEL)

Task = tuple[Likelihood, tuple[Parameter, ...], int]


def main(arguments: Sequence[str] | None = None) -> int:
    """Fit or report, as the command line says."""
    parser = argparse.ArgumentParser(prog="drawn", description="coverage on drawn experiments")
    commands = parser.add_subparsers(required=True)
    fit = commands.add_parser("fit", help="draw experiments and fit them")
    fit.add_argument("--experiments", nargs="*", default=["1-5"])
    fit.add_argument("--draws", type=int, default=100)
    fit.add_argument("--jobs", type=int, default=2)
    fit.add_argument("--work", type=Path, default=WORK)
    fit.set_defaults(do=_fit)
    told = commands.add_parser("report", help="print how often intervals hold the truth")
    told.set_defaults(do=lambda _: print("\n".join(report())))
    given = parser.parse_args(arguments)
    given.do(given)
    return 0


def _fit(given: argparse.Namespace) -> None:
    draw(given.experiments, given.draws, given.work, given.jobs)


def draw(
    experiments: Sequence[str], draws: int, work: Path, jobs: int, found: Path = FOUND
) -> None:
    """Draw and fit so many experiments from each fit of a known one, unless they are there.

    Args:
        experiments: numbers of the known ones, such as `1-5`.
        draws: from each.
        work: where the runs are kept.
        jobs: processes.
        found: file of the results.
    """
    there = {(line["name"], line["draw"]) for _, line in lines.read(found)}
    for known in chosen(experiments, []):
        numbers = [n for n in range(draws) if (known.name, n) not in there]
        if not numbers:
            continue
        with kept_runs(work / "runs.jsonl", CHANNELS, jobs) as kept:
            parts, campaign = fit_of(known, RUNS, work, kept)
            likely = likelihood(campaign.fitted.observations, campaign.fitted.emulators)
        parameters = parts.case.parameters
        tasks = [(likely, parameters, n) for n in numbers]
        with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
            for number, rank in zip(numbers, pool.map(rank_of_truth, tasks), strict=True):
                ranks = {p.name: round(r, 4) for p, r in zip(parameters, rank, strict=True)}
                lines.append(found, {"name": known.name, "draw": number, "rank": ranks})


def rank_of_truth(task: Task) -> list[float]:
    """Share of the posterior (d,) below the truth of one drawn experiment."""
    likely, parameters, number = task
    rng = np.random.default_rng(number)
    z = prior_transform(parameters)(rng.random(len(parameters)))
    residual, covariance = likely.residual(z)
    own = likely.scores - residual  # the emulators' mean
    drawn = own + np.linalg.cholesky(covariance) @ rng.normal(size=len(own))
    posterior = sample(with_scores(likely, drawn), parameters, seed=number)
    draws = to_unit(parameters, posterior.draws)
    return [float(share) for share in (draws < z).mean(axis=0)]


def report(found: Path = FOUND) -> list[str]:
    """How often intervals hold the truth, by parameter and over all."""
    ranks = [line["rank"] for _, line in lines.read(found)]
    if not ranks:
        return []
    told = [f"{len(ranks)} drawn experiments"]
    table: Array = np.array([list(rank.values()) for rank in ranks])
    for name, column in zip(ranks[0], table.T, strict=True):
        held = [float(np.mean(_held(column, level))) for level in LEVELS]
        pairs = zip(LEVELS, held, strict=True)
        told.append(
            f"  {name}: "
            + ", ".join(f"{held:.1%} in the {level:.0%} interval" for level, held in pairs)
        )
    pooled = _held(table, LEVEL)
    # Parameters of one experiment depend on each other: the experiments are what is counted.
    mean = pooled.mean(axis=1)
    sd = float(mean.std(ddof=1) / np.sqrt(len(mean))) if len(mean) > 1 else float("nan")
    told.append(
        f"  pooled: {float(pooled.mean()):.1%} in the {LEVEL:.0%} interval (+- {1.96 * sd:.1%})"
    )
    return told


def _held(rank: Array, level: float) -> Array:
    """Whether central intervals hold the truth."""
    return np.asarray(np.abs(rank - 0.5) <= level / 2.0)


if __name__ == "__main__":
    sys.exit(main())
