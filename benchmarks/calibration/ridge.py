"""Does a heap beside a discharge break the ridge of friction and rolling resistance?

    python -m benchmarks.calibration.ridge [--experiments 1-4] [--runs 60]

Each experiment is fitted twice: to a discharge alone, and to the same discharge and a heap of the
same beads. The recordings are made with another time step and other packings than the fit. `--runs`
are those of each fitted recording. Known fits are not made again.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import lines
from benchmarks.calibration.experiments import (
    CHANNELS,
    STATED,
    STEP,
    ZERO,
    case_head,
    recorded_text,
    rig,
)
from benchmarks.calibration.kept_runs import KeptRuns, kept_runs
from benchmarks.calibration.recovery import WORK, rank_of
from benchmarks.engine.agreement import seeds_of
from benchmarks.engine.scenes import engine_named
from calibration.campaign import calibrate
from calibration.runs import PREDICTED
from calibration.summary import summary
from mfopt.arrays import Array
from mfopt.study.case import assemble_case

FOUND = Path(__file__).parent / "results" / "ridge.jsonl"
RANGES = {"friction": (0.1, 0.8), "rolling_resistance.coefficient": (0.0, 0.3)}
ROLLING = list(RANGES)[1]
REPEATS = 3
ANGLE, RADIUS = 0.02, 0.002  # [rad], [m] 1 sd of reading the heap off a picture
RECORDED: Mapping[str, Mapping[str, float | str]] = {
    "discharge": {"opening_mm": 30.0},
    "heap": {"scene": "heap"},
}
HEAP = ("angle_of_repose", "radius_of_the_heap")


def main(arguments: Sequence[str] | None = None) -> int:
    """Fit, and print how much narrower the interval of rolling resistance gets."""
    parser = argparse.ArgumentParser(prog="ridge", description="a heap beside a discharge")
    parser.add_argument("--experiments", nargs="*", default=["1-4"])
    parser.add_argument("--runs", type=int, default=60)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--work", type=Path, default=WORK)
    given = parser.parse_args(arguments)
    there = {(line["number"], line["recordings"]) for _, line in lines.read(FOUND)}
    with kept_runs(given.work / "ridge.jsonl", (*CHANNELS, *HEAP), given.jobs) as kept:
        for number in seeds_of(given.experiments):
            for names in (("discharge",), ("discharge", "heap")):
                if (number, "+".join(names)) not in there:
                    line = fitted(number, names, given.runs, given.work, kept)
                    lines.append(FOUND, line)
    print("\n".join(report()))
    return 0


def truth_of(number: int) -> Array:
    """Drawn from the inner part of the ranges, in their order."""
    low, high = np.array(list(RANGES.values())).T
    return np.asarray(
        low + (high - low) * np.random.default_rng([22, number]).uniform(0.15, 0.85, len(RANGES))
    )


def fitted(
    number: int, names: Sequence[str], runs: int, work: Path, kept: KeptRuns
) -> dict[str, Any]:
    """Fit one experiment to some of its recordings."""
    parts = assemble_case(_write(number, names, work / f"ridge-{number}-{len(names)}"))
    whole = runs * len(names) + PREDICTED * len(names)
    campaign = calibrate(parts.case, parts.noises, lambda c: kept.evaluate(c, parts.ladder), whole)
    its = summary(campaign, parts.case, parts.problem, parts.noises, parts.rig.channels)
    truth = np.append(truth_of(number), STATED)
    rank = rank_of(truth, campaign.fitted.posterior)
    return {
        "number": number, "recordings": "+".join(names), "runs": its.runs,
        "truth": truth.round(4).tolist(), "rank": rank.round(4).tolist(),
        "intervals": [np.round(p.interval, 5).tolist() for p in its.parameters],
        "misfit": round(its.misfit, 1), "freedom": its.freedom,
    }  # fmt: skip


def _write(number: int, names: Sequence[str], directory: Path) -> Path:
    """The folder of a case with recordings by `numba`."""
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / "case.toml"
    if not path.exists():
        path.write_text(_text(number, names, directory))
    return path


def _text(number: int, names: Sequence[str], directory: Path) -> str:
    simulator = replace(
        rig(young_modulus_pa=STATED, timestep_factor=STEP), engine=engine_named("numba")
    )
    parts = case_head(f"ridge-{number}", RANGES)
    if "heap" in names:
        parts += [
            f"[measurement.angle_of_repose]\nnoise = {ANGLE}",
            f"[measurement.radius_of_the_heap]\nnoise = {RADIUS}",
        ]
    for place, name in enumerate(names):
        level = simulator.level(name, RECORDED[name], tuple(RANGES))
        rng = np.random.default_rng([23, number, place])
        seeds = [6_000_000 + 1000 * number + 10 * place + repeat for repeat in range(REPEATS)]
        raws = [level.evaluate(truth_of(number), seed=seed).raw for seed in seeds]
        shown = {k: f'"{v}"' if isinstance(v, str) else v for k, v in RECORDED[name].items()}
        conditions = ", ".join(f"{key} = {value}" for key, value in shown.items())
        head = f'[[recording]]\nname = "{name}"\nconditions = {{ {conditions} }}'
        if name == "heap":
            angle = [round(float(r[HEAP[0]]) + ANGLE * rng.normal(), 4) for r in raws]
            radius = [round(float(r[HEAP[1]]) + RADIUS * rng.normal(), 5) for r in raws]
            head += (
                f'\nscalars.{HEAP[0]} = {{ unit = "rad", values = {angle} }}'
                f'\nscalars.{HEAP[1]} = {{ unit = "m", values = {radius} }}'
            )
        else:
            zero = rng.normal(0.0, ZERO)
            for repeat, raw in enumerate(raws):
                text = recorded_text(raw, rng, zero, 0.0)
                (directory / f"{name}-{repeat + 1}.csv").write_text(text)
            head += f"\nfiles = {[f'{name}-{repeat + 1}.csv' for repeat in range(REPEATS)]}"
        parts.append(head)
    return "\n\n".join(parts) + "\n"


def report() -> list[str]:
    """Interval of rolling resistance with a heap over that without, and whether both are right."""
    by_number: dict[int, dict[str, Any]] = {}
    for _, line in lines.read(FOUND):
        by_number.setdefault(line["number"], {})[line["recordings"]] = line
    told, ratios = [], []
    place = list(RANGES).index(ROLLING)
    for number, its in sorted(by_number.items()):
        if len(its) == 2:
            alone, both = its["discharge"], its["discharge+heap"]
            width = [float(np.diff(line["intervals"][place])[0]) for line in (alone, both)]
            ratios.append(width[1] / width[0])
            held = [0.05 <= line["rank"][place] <= 0.95 for line in (alone, both)]
            told.append(
                f"{number}: rolling {alone['truth'][place]:.3f}, interval {width[0]:.3f} alone, "
                f"{width[1]:.3f} with a heap: ratio {ratios[-1]:.2f}; holds the truth: {held}"
            )
    if ratios:
        told.append(f"median ratio {np.median(ratios):.2f} over {len(ratios)} experiments")
    return told


if __name__ == "__main__":
    sys.exit(main())
