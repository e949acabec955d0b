"""Do two grain engines tell the same? Runs scenes on both over many seeds, and compares.

    python -m benchmarks.engine.agreement run --engines yade numba --scenes discharge heap silo
        --grains 300 1000 --seeds 1-10 --out DIR
    python -m benchmarks.engine.agreement report --in DIR --reference yade --out DIR2

A run that is there is not run again, so a campaign can be stopped and continued.
"""

import argparse
import json
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path

from benchmarks.engine.compare import (
    Row,
    as_mapping,
    compare,
    comparison_table,
    sample_table,
    samples,
)
from benchmarks.engine.figures import draw_all
from benchmarks.engine.runs import Run, add_run, read_runs, runs_in
from benchmarks.engine.scenes import engine_named, run_scene, scene_names
from mfopt.errors import ConfigError, MfoptError

Task = tuple[str, str, int, int]  # engine, scene, grains, seed


def main(arguments: Sequence[str] | None = None) -> int:
    """Run or report, as the command line says."""
    given = _parser().parse_args(arguments)
    try:
        return int(given.do(given))
    except MfoptError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="agreement", description="agreement of grain engines")
    commands = parser.add_subparsers(required=True)
    run = commands.add_parser("run", help="run scenes on engines")
    run.add_argument("--engines", nargs="+", required=True)
    run.add_argument("--scenes", nargs="+", required=True)
    run.add_argument("--grains", nargs="+", type=int, required=True)
    run.add_argument("--seeds", nargs="+", required=True, help="such as 1-10, or 1 3 5-8")
    run.add_argument("--out", type=Path, required=True)
    run.add_argument("--jobs", type=int, default=1, help="runs side by side")
    run.set_defaults(do=_run)
    report = commands.add_parser("report", help="compare the engines of finished runs")
    report.add_argument("--in", dest="directories", nargs="+", type=Path, required=True)
    report.add_argument("--reference", default="yade")
    report.add_argument("--out", type=Path, help="directory for JSON and figures")
    report.set_defaults(do=_report)
    return parser


def seeds_of(words: Sequence[str]) -> list[int]:
    """Seeds from words such as `3` and `5-8`.

    Raises:
        ConfigError: if a word is neither.
    """
    seeds: list[int] = []
    for word in words:
        first, _, last = word.partition("-")
        try:
            seeds += range(int(first), int(last or first) + 1)
        except ValueError:
            raise ConfigError(f"seeds {word!r} must be a number, or two such as 1-10") from None
    return seeds


def _run(given: argparse.Namespace) -> int:
    tasks = _tasks(given)
    for engine in given.engines:
        engine_named(engine).version()  # raises before anything ran if it is not installed
    given.out.mkdir(parents=True, exist_ok=True)
    print(f"{len(tasks)} runs to do", flush=True)
    if given.jobs == 1:
        for task in tasks:
            _keep(given.out, run_scene(*task))
        return 0
    with ProcessPoolExecutor(given.jobs, mp_context=get_context("spawn")) as pool:
        for done in as_completed([pool.submit(run_scene, *task) for task in tasks]):
            _keep(given.out, done.result())
    return 0


def _tasks(given: argparse.Namespace) -> list[Task]:
    """What is not there yet; seed after seed, so that a stopped campaign is balanced."""
    scenes, seeds = scene_names(given.scenes), seeds_of(given.seeds)
    there = {(run.engine, run.scene, run.grains, run.seed) for run in runs_in(given.out)}
    everything = [
        (engine, scene, grains, seed)
        for grains in given.grains
        for seed in seeds
        for scene in scenes
        for engine in given.engines
    ]
    return [task for task in everything if task not in there]


def _keep(directory: Path, run: Run) -> None:
    add_run(directory, run)
    name = f"{run.engine} {run.scene} {run.grains} {run.seed}"
    print(f"{name} {run.status} {run.cpu_s:.1f} CPU s {run.why or ''}".strip(), flush=True)


def _report(given: argparse.Namespace) -> int:
    runs = read_runs(given.directories)
    engines = sorted({run.engine for run in runs}, key=lambda name: (name != given.reference, name))
    print(sample_table([sample for engine in engines for sample in samples(runs, engine)]))
    for other in engines[1:]:
        rows = compare(runs, given.reference, other)
        print("\n" + comparison_table(rows, given.reference, other))
        if given.out is not None:
            _write(given.out / f"{given.reference}-{other}", rows)
            draw_all(runs, rows, (given.reference, other), given.out / f"{given.reference}-{other}")
    return 0


def _write(directory: Path, rows: Sequence[Row]) -> None:
    directory.mkdir(parents=True, exist_ok=True)
    content = json.dumps([as_mapping(row) for row in rows], indent=1)
    (directory / "agreement.json").write_text(content + "\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(main())
