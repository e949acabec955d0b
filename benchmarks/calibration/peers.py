"""Which method predicts held-out recordings best, at equal numbers of runs?

    python -m benchmarks.calibration.peers fit [--experiments 1-4] [--budgets 50 200]
    python -m benchmarks.calibration.peers report

The experiments are those of `benchmarks.calibration.experiments`, the methods those of
`peer_methods`. The parameters that a method finds are simulated under the conditions of each
held-out recording, on the same fresh packings for all methods; these runs do not count for any.
The error is the rms of recorded less mean over what measurement noise and packing explain. The
scatter of packings is that of all methods' runs, so that the yardstick is one. What was run or
judged once is not done again; `--work` is where the runs are kept.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import lines
from benchmarks.calibration.experiments import CHANNELS, Experiment, chosen, write_case
from benchmarks.calibration.kept_runs import KeptRuns, kept_runs
from benchmarks.calibration.peer_methods import METHODS
from benchmarks.calibration.recovery import WORK
from calibration.posterior import to_unit
from calibration.recordings.case import Case
from calibration.recordings.records import Noise
from calibration.runs import Evaluate, candidates, recording_with_runs, seeing
from mfopt.arrays import Array
from mfopt.study.case import assemble_case

FOUND = Path(__file__).parent / "results" / "peers.jsonl"
BUDGETS = (50, 200)
JUDGED = 6  # fresh packings under each held-out recording
FIRST_JUDGED = 9_000_000  # number of the first: its packing is in no fit

Lines = Sequence[Mapping[str, Any]]


def main(arguments: Sequence[str] | None = None) -> int:
    """Fit or report, as the command line says."""
    parser = argparse.ArgumentParser(prog="peers", description="methods at equal numbers of runs")
    commands = parser.add_subparsers(required=True)
    fit = commands.add_parser("fit", help="fit experiments by every method")
    fit.add_argument("--experiments", nargs="*", default=["1-4"])
    fit.add_argument("--budgets", nargs="*", type=int, default=BUDGETS)
    fit.add_argument("--methods", nargs="*", choices=METHODS, default=list(METHODS))
    fit.add_argument("--jobs", type=int, default=2)
    fit.add_argument("--work", type=Path, default=WORK)
    fit.set_defaults(do=_fit)
    told = commands.add_parser("report", help="print the errors on the held-out recordings")
    told.set_defaults(do=lambda _: print("\n".join(report(fits()))))
    given = parser.parse_args(arguments)
    given.do(given)
    return 0


def _fit(given: argparse.Namespace) -> None:
    there = {_key(line) for _, line in lines.read(FOUND)}
    with kept_runs(given.work / "peers.jsonl", CHANNELS, given.jobs) as kept:
        for budget in given.budgets:
            for experiment in chosen(given.experiments, []):
                for method in given.methods:
                    if (budget, experiment.name, method) not in there:
                        _fit_one(budget, experiment, method, given.work, kept)


def _fit_one(budget: int, experiment: Experiment, method: str, work: Path, kept: KeptRuns) -> None:
    parts = assemble_case(write_case(experiment, work / f"peers-{experiment.name}"))
    line = {
        "budget": budget, "experiment": experiment.name, "method": method,
        **fitted(
            method, parts.case, parts.noises, lambda c: kept.evaluate(c, parts.ladder), budget
        ),
    }  # fmt: skip
    lines.append(FOUND, line)
    print(budget, experiment.name, method, np.round(line["found"], 3), flush=True)


def fitted(
    method: str, case: Case, noises: Mapping[str, Noise], evaluate: Evaluate, budget: int
) -> dict[str, Any]:
    """Parameters that a method finds, and how far they are from the held-out recordings."""
    x = METHODS[method](case, noises, evaluate, budget)
    return {
        "found": [float(f"{v:.6g}") for v in x],
        "held_out": judged(case, noises, evaluate, x),
    }


def judged(
    case: Case, noises: Mapping[str, Noise], evaluate: Evaluate, x: Array
) -> list[dict[str, Any]]:
    """For each channel of each held-out recording, as means over its points:

    the square of recorded less simulated mean, the variance of one run, that of the measurement.
    """
    z = np.tile(to_unit(case.parameters, x), (JUDGED, 1))
    asked = candidates(case.parameters, [(r, z) for r in case.held_out], FIRST_JUDGED, "predict")
    made = evaluate(asked)
    told, see = [], seeing(case, noises)
    for recording in case.held_out:
        seen, _, rows = recording_with_runs(recording, made, see)
        parts = {
            "square": (seen.values - rows.mean(axis=0)) ** 2,
            "variance": rows.var(axis=0, ddof=1),
            "measured": np.diag(seen.measured) + np.sum(seen.constant**2, axis=1),
        }
        for block in seen.blocks:
            means = {k: float(seen.split(v)[block.channel].mean()) for k, v in parts.items()}
            told.append(
                {"recording": seen.name, "channel": block.channel, "repeats": seen.repeats,
                 "runs": len(rows), **means}
            )  # fmt: skip
    return told


def fits() -> Lines:
    """The fits made so far."""
    return [line for _, line in lines.read(FOUND)]


def errors(made: Lines) -> dict[tuple[int, str, str], float]:
    """Rms error of each fit over its held-out recordings and channels."""
    scatter: dict[tuple[str, str], list[float]] = {}
    for line in made:
        for its in line["held_out"]:
            scatter.setdefault((its["recording"], its["channel"]), []).append(its["variance"])
    pooled = {key: float(np.mean(each)) for key, each in scatter.items()}
    found = {}
    for line in made:
        squares = []
        for its in line["held_out"]:
            packing = pooled[its["recording"], its["channel"]]
            expected = packing * (1.0 / its["repeats"] + 1.0 / its["runs"]) + its["measured"]
            squares.append(its["square"] / expected)
        found[_key(line)] = float(np.sqrt(np.mean(squares)))
    return found


def report(made: Lines) -> list[str]:
    """Errors, and their ratios to the best method over the experiments that all methods fitted."""
    found = errors(made)
    told = []
    for budget in sorted({key[0] for key in found}):
        names = sorted({e for b, e, _ in found if b == budget})
        methods = [m for m in METHODS if any((budget, e, m) in found for e in names)]
        told.append(f"{budget} runs".ljust(14) + "".join(f"{m:>14}" for m in methods))
        for name in names:
            shown = [found.get((budget, name, m)) for m in methods]
            cells = ["-" if e is None else f"{e:.2f}" for e in shown]
            told.append(name.ljust(14) + "".join(f"{c:>14}" for c in cells))
        whole = [e for e in names if all((budget, e, m) in found for m in methods)]
        if whole:
            logs = np.log([[found[budget, e, m] for m in methods] for e in whole])
            best = int(logs.mean(axis=0).argmin())
            ratios = np.exp((logs - logs[:, [best]]).mean(axis=0))
            label = f"ratio, n = {len(whole)}"
            told.append(label.ljust(14) + "".join(f"{r:>14.2f}" for r in ratios))
            told.append(f"(geometric mean of the paired ratios to {methods[best]})")
    return told


def _key(line: Mapping[str, Any]) -> tuple[int, str, str]:
    return line["budget"], line["experiment"], line["method"]


if __name__ == "__main__":
    sys.exit(main())
