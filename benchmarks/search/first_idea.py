"""A dosing study against what an engineer would try first, and against random search.

    python -m benchmarks.search.first_idea STUDY.toml --out DIR [--seeds 1-5] [--random]

For each study seed `mfopt run` makes the whole study. The simple motions are run at the target on
seeds of their own, and the best of them there is run on the confirmation's seeds, as the study's
best design was. Random search draws designs within the bounds, runs them at the first level with
grains for as much work as the study's search may spend, and tells its best apart at the target as
the study does. What is there is taken as it is, so the command can be broken off.
"""

import argparse
import hashlib
import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mfopt.arrays import Array, frozen
from mfopt.campaign.phases import CONFIRM_SEED, FINALIST_SEED
from mfopt.records.level import Level
from mfopt.records.objective import Objective, judged
from mfopt.study.assemble import Assembled, assemble
from mfopt.study.file import Study, read_study
from mfopt.study.stored import open_stored

CHOICE_SEED = 2_000_000  # on which the best simple motion is chosen
RANDOM_SEED = 3_000_000  # of fillings that random search sees

Numbers = dict[str, float]  # objective, dispersion [s], filling time [s], mass left [-]


@dataclass(frozen=True)
class Machine:
    """A study's problem and levels, and where numbers of runs are kept."""

    study: Study
    parts: Assembled
    objective: Objective
    kept: Path

    def run(self, level: Level, x: Array, seed: int) -> Numbers:
        """One run, made or read."""
        file = self.kept / f"{level.name}-{seed}-{hash_of(x)}.json"
        if not file.exists():
            outcome, f = judged(self.objective, level.evaluate(x, seed=seed))
            asked = self.parts.criteria.quantities_of(outcome)
            file.write_text(json.dumps({"objective": f, **asked}), encoding="utf-8")
        kept: Numbers = json.loads(file.read_text(encoding="utf-8"))
        return kept

    def runs(self, level: Level, x: Array, seeds: Sequence[int]) -> list[Numbers]:
        """The same design on several seeds."""
        return [self.run(level, x, seed) for seed in seeds]


def hash_of(x: Array) -> str:
    """A name for a design."""
    return hashlib.sha256(x.tobytes()).hexdigest()[:16]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what is missing and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.search.first_idea")
    parser.add_argument("study", type=Path)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seeds", default="1-5", help="study seeds, such as 1-5")
    parser.add_argument("--random", action="store_true", help="random search too")
    given = parser.parse_args(arguments)
    study, text = read_study(given.study)
    parts = assemble(study, where=str(given.study))
    kept = given.out / "runs"
    kept.mkdir(parents=True, exist_ok=True)
    objective = parts.criteria.objective(study.problem.objective)
    machine = Machine(study, parts, objective, kept)
    fresh = range(CONFIRM_SEED, CONFIRM_SEED + study.confirm.seeds)
    name, simple = best_simple(machine)
    simple_runs = machine.runs(parts.ladder.top, simple, fresh)
    rows = [(f"best simple motion ({name})", simple_runs)]
    first, _, last = given.seeds.partition("-")
    for seed in range(int(first), int(last or first) + 1):
        rows.append((f"mfopt, study seed {seed}", confirmed(given.out, text, study, seed)))
        if given.random:
            x = random_search(machine, seed)
            rows.append((f"random, seed {seed}", machine.runs(parts.ladder.top, x, fresh)))
    print(table(rows, simple_runs))
    return 0


def best_simple(machine: Machine) -> tuple[str, Array]:
    """The start of the lowest mean objective at the target, on seeds of the choice alone."""
    starts = machine.parts.starts
    assert starts is not None, "the study has no simple motions"
    seeds = range(CHOICE_SEED, CHOICE_SEED + machine.study.confirm.finalist_seeds)
    top = machine.parts.ladder.top
    means = {
        name: np.mean([r["objective"] for r in machine.runs(top, x, seeds)])
        for name, x in starts.designs.items()
    }
    best = min(means, key=lambda name: means[name])
    return best, starts.designs[best]


def confirmed(out: Path, text: str, study: Study, seed: int) -> list[Numbers]:
    """The confirmation's runs of the best design that the study finds from a seed."""
    run, file = out / f"seed-{seed}", out / f"seed-{seed}.toml"
    head = f"seed = {study.study.seed}"
    assert text.count(head) == 1, f"the study must say {head!r} once"
    text = text.replace(head, f"seed = {seed}").replace("\nreference = ", "\n# reference = ")
    file.write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "mfopt", "run", str(file), "-d", str(run), "--resume", "-q"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(done.stderr)
    its, _ = open_stored(run)
    return [
        {"objective": e.objective, **its.criteria.quantities_of(e.outcome)}
        for e in its.evaluations()
        if e.candidate.purpose == "confirm best"
    ]


def random_search(machine: Machine, seed: int) -> Array:
    """The best of designs drawn within the bounds, for the work of the study's search."""
    problem, study, parts = machine.parts.problem, machine.study, machine.parts
    assert parts.starts is not None
    assert study.search.budget is not None
    level, top = parts.ladder[parts.starts.level], parts.ladder.top
    rng = np.random.default_rng(seed)
    count = int(study.search.budget * top.work(problem.baseline) / level.work(problem.baseline))
    found: list[tuple[float, Array]] = []
    while len(found) < count:
        x = frozen(problem.to_x(rng.random(problem.dimension)))
        if problem.impossible(x) is None:
            found.append((machine.run(level, x, RANDOM_SEED)["objective"], x))
    found.sort(key=lambda its: its[0])
    seeds = range(FINALIST_SEED, FINALIST_SEED + study.confirm.finalist_seeds)
    finalists = [x for _, x in found[: study.confirm.finalists]]
    means = [np.mean([r["objective"] for r in machine.runs(top, x, seeds)]) for x in finalists]
    return finalists[int(np.argmin(means))]


def table(rows: Sequence[tuple[str, Sequence[Numbers]]], simple: Sequence[Numbers]) -> str:
    """Medians over the fresh seeds, and the objective over that of the best simple motion."""
    lines = [
        "| design | objective | dispersion, ms | filling time, ms | most left, % | to simple |",
        "|---|---|---|---|---|---|",
    ]
    base = median(simple, "objective")
    for name, runs in rows:
        left = max(r.get("mass left", np.nan) for r in runs)
        f = median(runs, "objective")
        lines.append(
            f"| {name} | {f:.4f} | {1e3 * median(runs, 'dispersion'):.1f} | "
            f"{1e3 * median(runs, 'filling time'):.0f} | {100.0 * left:.3f} | {f / base:.3f} |"
        )
    return "\n".join(lines)


def median(runs: Sequence[Mapping[str, float]], name: str) -> float:
    """Median over runs; nan where one lacks it."""
    return float(np.median([r.get(name, np.nan) for r in runs]))


if __name__ == "__main__":
    sys.exit(main())
