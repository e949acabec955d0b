"""The assisted search against the planned one on the dosing scene, at the same work.

    python -m benchmarks.search.dosing --out DIR [--seeds 1-5] [--top 300] [--confirm 20]

For each seed both studies are run by `mfopt run`, one after the other; their best designs are
compared by the median objective over fresh fillings of the cup. The planned study goes
through `STAGES` up to the top level; its work is what the assisted
search may spend. A run that is there is resumed or taken as it is.
"""

import argparse
import json
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

HEAD = """[study]
name = "dosing"
seed = {seed}

[problem]
scene = "dosing"
objective = "dispersion"

[[level]]
name = "reduced"
engine = "reduced"
"""
LEVEL = """
[[level]]
name = "dem-{grains}"
engine = "numba"
grains = {grains}
young_modulus_pa = 1e6
"""
PLAN = """
[search]
method = "cma-es"
population_size = 10
seeds = 2
exchange = ["y1", "y2"]

[[search.stage]]
level = "reduced"
generations = 20
"""
STAGE = """
[[search.stage]]
level = "dem-{grains}"
generations = {generations}
sigma = {sigma}
"""
ASSISTED = """
[search]
budget = {budget}
seeds = 2
exchange = ["y1", "y2"]
"""
CONFIRM = """
[confirm]
seeds = {confirm}
"""
STAGES = ((300, 10, 0.06), (1000, 4, 0.04), (2000, 1, 0.03))  # grains, generations, sigma
RESAMPLES = 10_000


def main(arguments: Sequence[str] | None = None) -> int:
    """Run what is missing and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.search.dosing")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seeds", default="1-5", help="such as 1-5")
    parser.add_argument("--top", type=int, default=300, choices=[s[0] for s in STAGES])
    parser.add_argument("--confirm", type=int, default=20, help="fresh fillings")
    given = parser.parse_args(arguments)
    first, _, last = given.seeds.partition("-")
    rows = []
    for seed in range(int(first), int(last or first) + 1):
        planned = _run(given.out / f"planned-{seed}", planned_study(seed, given.top, given.confirm))
        budget = _search_work(given.out / f"planned-{seed}") / planned["full_run"]
        text = assisted_study(seed, given.top, given.confirm, budget)
        assisted = _run(given.out / f"assisted-{seed}", text)
        rows.append((seed, planned["confirmed_median"], assisted["confirmed_median"], budget))
        print(*rows[-1], flush=True)
    print(table(np.array(rows)))
    return 0


def _stages(top: int) -> tuple[tuple[int, int, float], ...]:
    return tuple(stage for stage in STAGES if stage[0] <= top)


def planned_study(seed: int, top: int, confirm: int) -> str:
    """Study file of the planned search."""
    stages = _stages(top)
    levels = "".join(LEVEL.format(grains=grains) for grains, _, _ in stages)
    plan = "".join(STAGE.format(grains=g, generations=n, sigma=s) for g, n, s in stages)
    return HEAD.format(seed=seed) + levels + PLAN + plan + CONFIRM.format(confirm=confirm)


def assisted_study(seed: int, top: int, confirm: int, budget: float) -> str:
    """Study file of the assisted search with a budget in full runs."""
    levels = "".join(LEVEL.format(grains=grains) for grains, _, _ in _stages(top))
    search = ASSISTED.format(budget=round(budget, 3))
    return HEAD.format(seed=seed) + levels + search + CONFIRM.format(confirm=confirm)


def _run(directory: Path, study: str) -> dict[str, float]:
    """Run a study, or take it as it is; its answer, and the work of a full run."""
    directory.mkdir(parents=True, exist_ok=True)
    file = directory / "given.toml"
    file.write_text(study, encoding="utf-8")
    command = [sys.executable, "-m", "mfopt", "run", str(file), "-d", str(directory / "run")]
    done = subprocess.run([*command, "--resume", "--json"], capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(done.stderr)
    header = json.loads((directory / "run" / "run.json").read_text(encoding="utf-8"))
    answer: dict[str, float] = json.loads(done.stdout)
    return {**answer, "full_run": header["levels"][-1]["work"]}


def _search_work(directory: Path) -> float:
    """Predicted work of all runs of the search, by which both are limited."""
    header = json.loads((directory / "run" / "run.json").read_text(encoding="utf-8"))
    work = {level["name"]: level["work"] for level in header["levels"]}
    journal = (directory / "run" / "journal.jsonl").read_text(encoding="utf-8").splitlines()
    lines = [json.loads(line) for line in journal]
    return float(sum(work[e["level"]] for e in lines if e.get("purpose") == "search"))


def table(rows: NDArray[np.float64]) -> str:
    """Medians by seed, and the geometric mean of planned over assisted with its interval."""
    logs = np.log(rows[:, 1] / rows[:, 2])
    picks = np.random.default_rng(1).integers(len(logs), size=(RESAMPLES, len(logs)))
    low, high = np.exp(np.quantile(logs[picks].mean(axis=1), [0.025, 0.975]))
    lines = ["| seed | planned | assisted | budget, full runs |", "|---|---|---|---|"]
    lines += [f"| {int(s)} | {p:.4g} | {a:.4g} | {b:.3g} |" for s, p, a, b in rows]
    mean = np.exp(logs.mean())
    return "\n".join([*lines, f"\nplanned / assisted: {mean:.3g} ({low:.3g} to {high:.3g})"])


if __name__ == "__main__":
    sys.exit(main())
