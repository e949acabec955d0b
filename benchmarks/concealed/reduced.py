"""Concealed cases on reduced models: how often is the missing effect named, and how often wrongly?

    python -m benchmarks.concealed.reduced run [--cases 300] [--seed N] [--jobs 2]
    python -m benchmarks.concealed.reduced report

The seed comes from the system's entropy unless one is given. Kinds of cases follow a fixed
schedule; nothing that was drawn is dropped. The size of an effect is such that its distance D, the
largest noise-free difference after a refit over the deviation of the mean of the repeats, is 1.5, 4
or 7 if the effect can reach that.
"""

import argparse
import secrets
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import lines
from benchmarks.calibration.experiments import correlated_noise
from benchmarks.concealed.distance import differences, furthest
from benchmarks.concealed.found import line_of
from benchmarks.concealed.models import MODELS, Model
from benchmarks.concealed.oracle import oracle_error
from benchmarks.concealed.places import by_window
from benchmarks.concealed.score import report
from calibration.diagnosis.diagnose import Examined, beside, examine, joined, suspected
from calibration.diagnosis.joint import Joint
from calibration.diagnosis.library import Library
from calibration.observed import Observed
from calibration.runs import seeing
from mfopt.arrays import Array, frozen
from mfopt.records.evaluation import Evaluation
from mfopt.records.outcome import Outcome
from mfopt.study.case import AssembledCase, assemble_case
from mfopt.study.rig_library import assemble_library
from surrogates.series import SeriesEmulator, fit_effect_series

FOUND = Path(__file__).parent / "results" / "reduced.jsonl"
RUNS = 200  # of each experiment
TARGETS = (1.5, 4.0, 7.0)
# As in the sealed set: 80 nulls, of which 20 with misjudged noise; 90 singles, 20 pairs, 30 others.
SCHEDULE = (
    "null", "single", "single", "outside", "null", "single", "misjudged", "single", "null",
    "single", "pair", "null", "single", "single", "outside", "null", "single", "misjudged",
    "single", "null", "single", "pair",
)  # fmt: skip
STEPS = 4.0  # of quantised values in a standard deviation of the noise
UNDERSTATED = 0.5  # noise that a case states over the true one, where it is misjudged
REPEATS = 2
HALVINGS = 7  # of the interval in which the size of an effect is sought

Values = dict[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """A model with the emulators of its experiments."""

    model: Model
    library: Library
    emulators: tuple[SeriesEmulator, ...]
    joint: Joint  # of some recordings, to measure distances by
    observations: tuple[Observed, ...]

    @property
    def fitted(self) -> int:
        """How many recordings are fitted; they come first."""
        return len(self.joint.likelihood.groups)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run cases or report, as the command line says."""
    parser = argparse.ArgumentParser(prog="reduced", description="concealed cases, reduced models")
    commands = parser.add_subparsers(required=True)
    run = commands.add_parser("run", help="draw, make and diagnose cases")
    run.add_argument("--cases", type=int, default=300)
    run.add_argument("--seed", type=int, default=None)
    run.add_argument("--jobs", type=int, default=2)
    run.add_argument("--out", type=Path, default=FOUND)
    run.set_defaults(do=_run)
    told = commands.add_parser("report", help="print how often the effect was named")
    told.add_argument("--out", type=Path, default=FOUND)
    told.set_defaults(do=lambda its: print("\n".join(report([x for _, x in lines.read(its.out)]))))
    given = parser.parse_args(arguments)
    given.do(given)
    return 0


def _run(given: argparse.Namespace) -> None:
    seed = secrets.randbits(60) if given.seed is None else given.seed
    there = {(line["seed"], line["case"]) for _, line in lines.read(given.out)}
    asked = [(seed, n) for n in range(given.cases) if (seed, n) not in there]
    with ProcessPoolExecutor(given.jobs, mp_context=get_context("spawn")) as pool:
        for line in pool.map(one, asked):
            lines.append(given.out, line)
            print(line["case"], line["model"], line["kind"], sorted(line["truth"]),
                  f"D {line['distance']:.1f}", line["verdict"], *line["effects"],
                  f"{line['cpu_s']:.1f} s", flush=True)  # fmt: skip


def one(which: tuple[int, int]) -> dict[str, Any]:
    """Draw, make and diagnose one case of a seed."""
    seed, number = which
    begun = time.process_time()
    rng = np.random.default_rng([seed, number])
    kind = SCHEDULE[number % len(SCHEDULE)]
    its = prepared(number % len(MODELS))
    model = its.model
    base = {n: float(rng.uniform(*ends)) for n, ends in model.parameters.items()}
    truth = drawn(kind, its, base, rng)
    found = _examined(its, base | truth, rng, kind == "misjudged")
    cpu_s = time.process_time() - begun
    apart = moved(its, base | truth)
    return {
        "seed": seed, "case": number, "model": model.name, "kind": kind, "truth": truth,
        "distance": furthest(apart), **line_of(found, its.fitted), **_known(its, found, truth),
        "true_cells": by_window(its.observations[: its.fitted], apart), "cpu_s": round(cpu_s, 2),
    }  # fmt: skip


def _examined(its: Prepared, values: Values, rng: np.random.Generator, misjudged: bool) -> Examined:
    """What a diagnosis finds in recordings of these values."""
    with tempfile.TemporaryDirectory() as folder:
        parts = assemble_case(written(its.model, values, Path(folder), rng, misjudged))
        seen = _seen(parts, its)
    return examine(parts.case, its.library, seen, its.emulators, parts.rig.channels)


def _known(its: Prepared, found: Examined, truth: Values) -> dict[str, Any]:
    """What a case is judged by beside its truth: true strengths, and the error of an oracle.

    Effects outside of the library have no strength, and no oracle fits them.
    """
    effects = {e.name: e for e in its.library.effects}
    strengths = {n: round(effects[n].strength(v), 5) for n, v in truth.items() if n in effects}
    there = [s for s in suspected(its.library, found.measuring) if s.name in strengths]
    d = len(its.model.parameters)
    error = oracle_error(found.joint, found.observations, its.fitted, there, d) if there else None
    return {"true_strengths": strengths, "oracle": error}


def drawn(kind: str, its: Prepared, base: Values, rng: np.random.Generator) -> Values:
    """The effects of a case, with their sizes."""
    model = its.model
    if kind in ("null", "misjudged"):
        return {}
    if kind == "outside":
        names, targets = [str(rng.choice(list(model.outside)))], [7.0]
    elif kind == "pair":
        names = [str(n) for n in rng.choice(list(model.effects), 2, replace=False)]
        targets = [7.0, 7.0]
    else:
        names, targets = [str(rng.choice(list(model.effects)))], [float(rng.choice(TARGETS))]
    return {n: _sized(n, t, its, base) for n, t in zip(names, targets, strict=True)}


def _sized(name: str, target: float, its: Prepared, base: Values) -> float:
    """Size of an effect at which its distance is the target, or the largest one."""
    full = {**its.model.effects, **its.model.outside}[name][1]
    low, high = 0.0, 1.0
    if distance(its, {**base, name: full}) <= target:
        return full
    for _ in range(HALVINGS):
        middle = (low + high) / 2.0
        far = distance(its, {**base, name: full * middle**2}) > target
        low, high = (low, middle) if far else (middle, high)
    return full * ((low + high) / 2.0) ** 2


def distance(its: Prepared, values: Values) -> float:
    """Largest noise-free difference after a refit, over the deviation of the repeats' mean."""
    return furthest(moved(its, values))


def moved(its: Prepared, values: Values) -> list[Array]:
    """Noise-free differences (p,) after a refit, over the deviation of the repeats' mean."""
    rows = []
    for seen in its.observations[: its.fitted]:
        conditions = its.model.experiments[seen.name]
        runs = [its.model.run(values, conditions, seed) for seed in MIRRORED]
        rows.append(seen.row({k: np.mean([r[k] for r in runs], axis=0) for k in runs[0]}))
    return differences(its.joint, rows, len(its.model.parameters))


MIRRORED = range(40)  # seeds over which a run is averaged: the scatter falls to a sixth


@cache
def prepared(number: int) -> Prepared:
    """A model with its emulators; learned once in each process."""
    model = MODELS[number]
    base = {n: sum(ends) / 2.0 for n, ends in model.parameters.items()}
    with tempfile.TemporaryDirectory() as folder:
        path = written(model, base, Path(folder), np.random.default_rng(1), False)
        parts = assemble_case(path)
        shared = assemble_library(parts, further=False)
        made = []
        for candidate in shared.library.planned(list(shared.conditions), RUNS):
            values = dict(zip(shared.library.names, map(float, candidate.x), strict=True))
            raw = model.run(values, shared.conditions[candidate.level], candidate.seed)  # type: ignore[arg-type]
            frozen_raw = {k: frozen(v) for k, v in raw.items()}
            outcome = Outcome(
                candidate.x, candidate.level, candidate.seed, "finished", None, frozen_raw, 1.0, 0.0
            )
            made.append(Evaluation(candidate, outcome, 0.0))
        see, seen, emulators = seeing(parts.case, parts.noises), [], []
        for recording in (*parts.case.fitted, *parts.case.held_out):
            name = shared.experiments[recording.name]
            its, runs, rows = beside(recording, name, made, shared.library, see)
            seen.append(its)
            emulators.append(fit_effect_series(runs, rows, [b.size for b in its.blocks]))
    count = len(parts.case.fitted)
    _, whole = joined(parts.case, seen, emulators, parts.rig.channels)
    return Prepared(
        model, shared.library, tuple(emulators), whole.of(range(count)), tuple(seen)
    )  # fmt: skip


def _seen(parts: AssembledCase, its: Prepared) -> list[Observed]:
    """The recordings of a case on the points of the emulators."""
    see = seeing(parts.case, parts.noises)
    ends = {seen.name: seen.end for seen in its.observations}
    recordings = (*parts.case.fitted, *parts.case.held_out)
    return [see(recording, ends[recording.name]) for recording in recordings]


def written(
    model: Model, values: Values, folder: Path, rng: np.random.Generator, misjudged: bool
) -> Path:
    """The files of a case: recordings of these values, and the case file."""
    parts = [
        f'[case]\nname = "{model.name}"\nseed = 1',
        f'[rig]\nfunction = "{Path(__file__).with_name("models.py")}:{model.run.__name__}"',
        *(
            f'[rig.channels.{c}]\nunit = "{unit}"\nsize = {size}'
            for c, (unit, size, _) in model.channels.items()
        ),
        *(f"[parameters.{n}]\nrange = {list(ends)}" for n, ends in model.parameters.items()),
        "[effects]\n" + "\n".join(
            f"{n} = {{ range = {list(ends)} }}" for n, ends in model.effects.items()
        ),
    ]  # fmt: skip
    if misjudged:
        parts += [
            f"[measurement.{c}]\nnoise = {UNDERSTATED * sd}"
            for c, (_, _, sd) in model.channels.items()
        ]
    for name, conditions in model.experiments.items():
        held_out = name == model.held_out
        count = 1 if held_out else REPEATS
        files = [f"{name}-{k}.csv" for k in range(count)]
        for file in files:
            seed = int(rng.integers(1 << 40)) + 1000
            (folder / file).write_text(_recorded(model, values, conditions, seed, rng))
        told = ", ".join(f"{k} = {v}" for k, v in conditions.items())
        parts.append(
            f'[[recording]]\nname = "{name}"\nconditions = {{ {told} }}\nfiles = {files}\n'
            f"held_out = {str(held_out).lower()}"
        )
    path = folder / "case.toml"
    path.write_text("\n\n".join(parts) + "\n")
    return path


def _recorded(
    model: Model, values: Values, conditions: Mapping[str, float], seed: int,
    rng: np.random.Generator,
) -> str:  # fmt: skip
    """The text of a CSV file: a run with noise, quantised."""
    raw = model.run(values, conditions, seed)
    times = np.arange(0.0, raw["time"][-1] + 1e-9, 1.0 / model.rate)
    columns = [times]
    for channel, (_, _, sd) in model.channels.items():
        noisy = np.interp(times, raw["time"], raw[channel]) + correlated_noise(rng, len(times), sd)
        columns.append(np.round(noisy * STEPS / sd) * sd / STEPS)
    head = ",".join(["time [s]", *(f"{c} [{unit}]" for c, (unit, _, _) in model.channels.items())])
    rows = [",".join(f"{v:.9g}" for v in row) for row in np.array(columns).T]
    return "\n".join([head, *rows]) + "\n"


if __name__ == "__main__":
    sys.exit(main())
