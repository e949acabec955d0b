"""Do fits find the parameters that recordings were made with?

    python -m benchmarks.calibration.recovery fit [--experiments 1-20] [--soft 1-10] [--runs 200]
    python -m benchmarks.calibration.recovery report

The experiments are those of `benchmarks.calibration.experiments`. All fits share the runs that
spread the parameters over their ranges. What was run or fitted once is not done again; `--work` is
where the runs are kept.
"""

import argparse
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import lines
from benchmarks.calibration.experiments import (
    CHANNELS,
    SETTINGS,
    TRUTHS,
    Experiment,
    chosen,
    write_case,
)
from benchmarks.calibration.kept_runs import KeptRuns, kept_runs
from calibration.campaign import Campaign, calibrate
from calibration.posterior import Posterior
from calibration.summary import summary
from calibration.words import DETERMINED
from mfopt.arrays import Array
from mfopt.records.evaluation import Candidate, Evaluation
from mfopt.study.case import AssembledCase, assemble_case

FOUND = Path(__file__).parent / "results" / "recovery.jsonl"
WORK = Path("runs") / "calibration-benchmark"
RUNS = 200
STIFFNESS = "young_modulus"  # fitted along
PREDICTED = 6  # runs for each recording beside those that fit


def main(arguments: Sequence[str] | None = None) -> int:
    """Fit or report, as the command line says."""
    parser = argparse.ArgumentParser(prog="recovery", description="fits of known experiments")
    commands = parser.add_subparsers(required=True)
    fit = commands.add_parser("fit", help="fit experiments")
    fit.add_argument("--experiments", nargs="*", default=["1-20"])
    fit.add_argument("--soft", nargs="*", default=["1-10"])
    fit.add_argument("--runs", type=int, default=RUNS)
    fit.add_argument("--jobs", type=int, default=2)
    fit.add_argument("--work", type=Path, default=WORK)
    fit.set_defaults(do=_fit)
    told = commands.add_parser("report", help="print how often the truth was found")
    told.set_defaults(do=lambda given: print("\n".join(report())))
    given = parser.parse_args(arguments)
    given.do(given)
    return 0


def _fit(given: argparse.Namespace) -> None:
    there = {(line["name"], line["runs"]) for _, line in lines.read(FOUND)}
    with kept_runs(given.work / "runs.jsonl", CHANNELS, given.jobs) as kept:
        for experiment in chosen(given.experiments, given.soft):
            if (experiment.name, given.runs) not in there:
                line = fitted(experiment, given.runs, given.work, kept)
                lines.append(FOUND, line)
                print(shown(line), flush=True)


def fitted(experiment: Experiment, runs: int, work: Path, kept: KeptRuns) -> dict[str, Any]:
    """Fit one experiment; `runs` are those of a case that has held-out recordings too."""
    begun, before = time.process_time(), len(kept.there)
    parts, campaign = fit_of(experiment, runs, work, kept)
    cpu_s = time.process_time() - begun
    its = summary(campaign, parts.case, parts.problem, parts.noises, parts.rig.channels)
    truth = np.append(experiment.truth, experiment.stiffness)
    rank = rank_of(truth, campaign.fitted.posterior)
    return {
        "name": experiment.name, "kind": experiment.kind, "runs": runs,
        "truth": experiment.truth.tolist(),
        "rank": rank.round(4).tolist(),
        "found": [
            {"mean": round(p.mean, 4), "share": round(p.share, 3), "determined": p.determined}
            for p in its.parameters
        ],
        "misfit": round(its.misfit, 1), "freedom": its.freedom,
        "compared": [
            {"recording": c.recording, "channel": c.channel, "held_out": c.held_out,
             "error": round(c.error, 3)}
            for c in its.compared
        ],
        "new_runs": len(kept.there) - before, "runs_cpu_s": round(its.cpu_s, 1),
        "fit_cpu_s": round(cpu_s, 1),
    }  # fmt: skip


def fit_of(
    experiment: Experiment, runs: int, work: Path, kept: KeptRuns
) -> tuple[AssembledCase, Campaign]:
    """The case of an experiment, and its fit."""
    parts = assemble_case(write_case(experiment, work / experiment.name))
    # Equally many runs for each fitted recording, so that experiments share them.
    whole = runs - PREDICTED * (len(SETTINGS) - len(experiment.settings))

    def evaluate(candidates: Sequence[Candidate]) -> list[Evaluation]:
        return kept.evaluate(candidates, parts.ladder)

    return parts, calibrate(parts.case, parts.noises, evaluate, whole)


def rank_of(truth: Array, posterior: Posterior) -> Array:
    """Share of the posterior (d,) below the true parameters (d,)."""
    return np.asarray((posterior.draws < truth).mean(axis=0))


def shown(line: Mapping[str, Any]) -> str:
    """A fit in one line: for each parameter the rank of the truth and the share of the prior."""
    ranks = " ".join(
        f"{r:.2f}({f['share']:.2f})" for r, f in zip(line["rank"], line["found"], strict=True)
    )
    errors = " ".join(f"{c['error']:.2f}" for c in line["compared"])
    misfit = f"{line['misfit']}/{line['freedom']}"
    return f"{line['name']} {ranks} misfit {misfit} errors {errors} fit {line['fit_cpu_s']} s"


def report(found: Path = FOUND) -> list[str]:
    """How often the truth was found, in lines."""
    fits = [line for _, line in lines.read(found)]
    told = []
    for kind, runs in sorted({(line["kind"], line["runs"]) for line in fits}):
        of = [line for line in fits if (line["kind"], line["runs"]) == (kind, runs)]
        told.append(f"{kind}: {len(of)} experiments, {runs} runs each")
        told += [_coverage(of, place, name) for place, name in enumerate([*TRUTHS, STIFFNESS])]
        held = [c["error"] for line in of for c in line["compared"] if c["held_out"]]
        if held:
            told.append(
                f"  held-out error over what is explained: median {np.median(held):.2f}, root "
                f"mean square {np.sqrt(np.mean(np.square(held))):.2f}, largest {max(held):.2f}"
            )
        fit, simulated = ([line[k] for line in of] for k in ("fit_cpu_s", "runs_cpu_s"))
        told.append(
            f"  CPU: simulations {np.median(simulated):.0f} s, emulators and posterior "
            f"{np.median(fit):.0f} s (medians)"
        )
    return told


def _coverage(of: Sequence[Mapping[str, Any]], place: int, name: str) -> str:
    """How often intervals of a parameter hold its truth, and how narrow they are."""
    ranks = np.array([line["rank"][place] for line in of])
    shares = np.array([line["found"][place]["share"] for line in of])
    sure = np.array([line["found"][place]["determined"] for line in of])
    held, wide = np.abs(ranks - 0.5) <= 0.45, np.abs(ranks - 0.5) <= 0.475
    return (
        f"  {name}: in the 90 % interval {held.sum()} of {len(of)} ({held[sure].sum()} of "
        f"{sure.sum()} that are determined), outside the 95 % interval {(~wide).sum()}; narrower "
        f"than half the prior {(shares < DETERMINED).sum()}, median {np.median(shares):.2f}"
    )


if __name__ == "__main__":
    sys.exit(main())
