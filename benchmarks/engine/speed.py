"""How fast the engine `numba` is, against YADE and against itself.

    python -m benchmarks.engine.speed --out DIR [--what flow dosing kept side full start] [--quick]

Runs alternate between the engines, one process at a time, and ratios are taken within each
pair, because the machine's speed changes from minute to minute. Each measurement is one line of
`DIR/speed.jsonl`, appended when it is made: a second call goes on where the first ended. The
table of medians and ranges is printed at the end.

CPU seconds are those of the process that moves the grains. In dense flow those of a run of one
step are taken off, so that starting YADE does not count; in a dosing run it does.
"""

import argparse
import json
import multiprocessing
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import lines
from benchmarks.engine.scenes import DESIGNS, TIME_LIMIT_S, hopper, portion_of
from fidelity.engine import Engine, Movement, Setup
from fidelity.engines.numba import NumbaEngine
from fidelity.engines.yade.engine import YadeEngine
from fidelity.grains.filling import filled
from fidelity.grains.packing import default_cache, settled_packing
from fidelity.grains.settings import DemSettings
from fidelity.scenes.discharge import run as discharge
from fidelity.scenes.dosing.design import design, dosing_problem
from fidelity.scenes.dosing.run import cup_filling, dosing_setup, tally
from fidelity.scenes.dosing.settings import DosingSettings
from mfopt.errors import SimulationError

FLOW_S = 0.1  # [s] of discharge, from a full hopper
DESIGN = "wide"  # of the dosing runs: it empties the cup
SIDE_RUNS = 3  # one after the other, by each of two processes side by side
FULL_GRAINS, FULL_MODULUS = 18380, 1e8  # the paper's full level

Measurement = dict[str, Any]


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure what is asked for and not measured yet, and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.engine.speed")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--what", nargs="+", choices=[*PARTS], default=[*PARTS])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--quick", action="store_true", help="small sizes, two repeats, no `full`")
    given = parser.parse_args(arguments)
    file = given.out / "speed.jsonl"
    done = [measurement for _, measurement in lines.read(file)]
    for what in given.what:
        if what == "full" and given.quick:
            continue
        for key, measure in PARTS[what](given.quick):
            repeats = 2 if given.quick else 1 if what == "full" else given.repeats
            for _ in range(repeats - sum(m["key"] == key for m in done)):
                made = {"key": key, **measure()}
                done.append(made)
                lines.append(file, made)
                print(json.dumps(made), flush=True)
    print(table(done))
    return 0


Part = Iterator[tuple[str, Callable[[], Measurement]]]


def flow(quick: bool) -> Part:
    """Dense flow: same grains, same state, same step."""
    for grains in (300,) if quick else (1000, 4600):
        yield f"flow {grains}", partial(_flow, grains)


def _flow(grains: int) -> Measurement:
    setup = flow_setup(grains)
    yade = YadeEngine()
    dt = _step(yade, setup)
    return _ratio(*(_rate(engine, setup) for engine in (yade, NumbaEngine(fixed_timestep=dt))))


@cache
def flow_setup(grains: int) -> Setup:
    """A hopper that starts to run out, its grains settled by `numba`."""
    portion = portion_of(grains)
    packing, _ = filled(
        NumbaEngine(), discharge.filling_setup(hopper(), portion, 1), time_limit_s=TIME_LIMIT_S
    )
    return replace(discharge.discharge_setup(hopper(), portion, packing), duration=FLOW_S)


def _step(engine: Engine, setup: Setup) -> float:
    wall = setup.walls[0].material
    return engine.timestep(setup.grain, setup.grain_material, wall, setup.physics)


def _rate(engine: Engine, setup: Setup) -> float:
    """Sphere-steps per CPU second, without the start."""
    one_step = replace(setup, duration=0.5 * _step(engine, setup))
    engine.move(one_step, time_limit_s=TIME_LIMIT_S)  # compiled and loaded
    start = _done(engine.move(one_step, time_limit_s=TIME_LIMIT_S))
    run = _done(engine.move(setup, time_limit_s=TIME_LIMIT_S))
    return (run.sphere_steps - start.sphere_steps) / (run.cpu_s - start.cpu_s)


def _done(movement: Movement) -> Movement:
    if movement.status != "finished":
        raise SimulationError(movement.why or movement.status)
    return movement


def _ratio(yade: float, numba: float) -> Measurement:
    return {"yade": yade, "numba": numba, "ratio": numba / yade, "unit": "sphere-steps/s"}


def dosing(quick: bool) -> Part:
    """A whole dosing run from the same packing, each engine at its own step, start included."""
    for grains in (300,) if quick else (1000, 4600):
        yield f"dosing {grains}", partial(_dosing, grains)


def _dosing(grains: int) -> Measurement:
    setup, passed = dosing_case(grains)
    cost = {}
    for engine in (YadeEngine(), NumbaEngine()):
        engine.move(replace(setup, duration=1e-6), time_limit_s=TIME_LIMIT_S)  # compiled
        movement = _done(engine.move(setup, time_limit_s=TIME_LIMIT_S))
        cost[engine.name] = movement.cpu_s
        cost[f"{engine.name} passed"] = passed(movement)
    return {**cost, "ratio": cost["yade"] / cost["numba"], "unit": "CPU s"}


def dosing_case(grains: int, young_modulus: float = 1e6) -> tuple[Setup, Callable[[Movement], int]]:
    """A dosing run of the design, and how many grains of a movement passed."""
    settings = DosingSettings()
    dem = DemSettings(grains=grains, young_modulus_pa=young_modulus)
    problem = dosing_problem(settings)
    values = dict(zip(problem.names, map(float, problem.baseline), strict=True))
    values.update(DESIGNS[DESIGN])
    machine = design(settings, np.array([values[name] for name in problem.names]))
    order = cup_filling(settings, dem, 1)
    packing = settled_packing(NumbaEngine(), order, default_cache(), time_limit_s=TIME_LIMIT_S)
    setup = dosing_setup(settings, machine, order, packing.packing)
    return setup, lambda movement: len(tally(machine, setup, movement).passed)


def kept(quick: bool) -> Part:
    """Speed in dense flow at the full number of grains over that at 1000."""
    small, large = (300, 1000) if quick else (1000, FULL_GRAINS)
    yield f"kept {small} to {large}", partial(_kept, small, large)


def _kept(small: int, large: int) -> Measurement:
    rates = []
    for grains in (small, large):
        setup = flow_setup(grains)
        engine = NumbaEngine(fixed_timestep=_step(YadeEngine(), setup))
        rates.append(_rate(engine, replace(setup, duration=FLOW_S * (small / grains) ** 0.5)))
    return {
        "small": rates[0],
        "large": rates[1],
        "ratio": rates[1] / rates[0],
        "unit": "sphere-steps/s",
    }


def side(quick: bool) -> Part:
    """Two runs side by side on two cores: runs per second over those of one alone."""
    grains = 300 if quick else 1000
    yield f"side by side {grains}", partial(_side, grains)


def _side(grains: int) -> Measurement:
    setup, _ = dosing_case(grains)
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        pool.map(_wall_s, [replace(setup, duration=1e-3)] * 2, chunksize=1)  # compiled and loaded
        alone = pool.apply(_wall_s, (setup, SIDE_RUNS))
        began = time.perf_counter()
        pool.starmap(_wall_s, [(setup, SIDE_RUNS)] * 2, chunksize=1)
        together = time.perf_counter() - began
        alone = (alone + pool.apply(_wall_s, (setup, SIDE_RUNS))) / 2  # before and after
    return {"alone": alone, "together": together, "ratio": 2 * alone / together, "unit": "s"}


def _wall_s(setup: Setup, runs: int = 1) -> float:
    began = time.perf_counter()
    for _ in range(runs):
        _done(NumbaEngine().move(setup, time_limit_s=TIME_LIMIT_S))
    return time.perf_counter() - began


def full(quick: bool) -> Part:
    """The full level: 18 380 grains of 5 spheres, E = 1e8 Pa; settling left out."""
    yield "full level", _full


def _full() -> Measurement:
    setup, passed = dosing_case(FULL_GRAINS, FULL_MODULUS)
    NumbaEngine().move(tiny_setup(), time_limit_s=TIME_LIMIT_S)  # compiled and loaded
    movement = _done(NumbaEngine().move(setup, time_limit_s=TIME_LIMIT_S))
    return {
        "minutes": movement.cpu_s / 60,
        "steps": movement.steps,
        "rate": movement.sphere_steps / movement.cpu_s,
        "passed": passed(movement),
        "unit": "CPU min",
    }


START = """
import time
began = time.perf_counter()
from benchmarks.engine.speed import tiny_setup
from fidelity.engines.numba import NumbaEngine
NumbaEngine().move(tiny_setup(), time_limit_s=60.0)
print(time.perf_counter() - began)
"""


def start(quick: bool) -> Part:
    """From a fresh process to the first step, with compiled code in the cache."""
    yield "start", _start


def _start() -> Measurement:
    seconds = []
    for _ in range(2):  # the first may compile
        began = time.perf_counter()
        subprocess.run([sys.executable, "-c", START], check=True, capture_output=True)
        seconds.append(time.perf_counter() - began)
    return {"seconds": seconds[1], "unit": "s"}


def tiny_setup() -> Setup:
    """One step of a few grains in free fall over the hopper."""
    portion = portion_of(50)
    setup = discharge.filling_setup(hopper(), portion, 1)
    return replace(setup, duration=1e-6)


PARTS: dict[str, Callable[[bool], Part]] = {
    "flow": flow, "dosing": dosing, "kept": kept, "side": side, "full": full, "start": start,
}  # fmt: skip


def table(measurements: Sequence[Measurement]) -> str:
    """Median and range of every quantity, as Markdown."""
    lines = ["| measurement | what | median | lowest to highest | n |", "|---|---|---|---|---|"]
    for key in dict.fromkeys(m["key"] for m in measurements):
        mine = [m for m in measurements if m["key"] == key]
        for name in (n for n in mine[0] if n not in ("key", "unit")):
            values = np.array([m[name] for m in mine], dtype=float)
            unit = "" if name == "ratio" or "passed" in name else f" {mine[0]['unit']}"
            lines.append(
                f"| {key} | {name}{unit if name not in ('steps', 'rate') else ''} "
                f"| {np.median(values):.4g} | {values.min():.4g} to {values.max():.4g} "
                f"| {len(values)} |"
            )
    return "\n".join(lines)


if __name__ == "__main__":
    sys.exit(main())
