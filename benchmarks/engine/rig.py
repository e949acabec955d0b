"""The discharge rig of calibration and diagnosis on two engines: fraction and level over time.

    python -m benchmarks.engine.rig run --engine yade --factor 0.6 --seeds 1-8 --out DIR
    python -m benchmarks.engine.rig run --engine yade --factor 1.3 --seeds 1-4 --effects all --out DIR
    python -m benchmarks.engine.rig report --in DIR

1 800 spheres of 5 mm +-5 %, E = 2 MPa, Hertz-Mindlin, restitution 0.7, leave a box of 120 x 30 mm
through a slot of 30 mm in a floor of 4 mm. `--factor` is the time step over r_min sqrt(density / E);
without one the step is the default of the scene. Both engines start from the same packing.
A run that is there is not run again.
"""  # noqa: E501

import argparse
import math
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks import lines
from benchmarks.engine.agreement import seeds_of
from benchmarks.engine.rig_report import Curves, report
from benchmarks.engine.scenes import engine_named
from fidelity.effects.kinds import Values
from fidelity.effects.switch import effect_named
from fidelity.engine import Engine
from fidelity.engines.numba import NumbaEngine
from fidelity.grains.settings import DemSettings, MaterialSettings
from fidelity.level import SceneLevel
from fidelity.scenes.discharge.scene import Discharge
from fidelity.scenes.discharge.settings import Hopper
from mfopt.errors import ConfigError, MfoptError

NONE = "none"  # the rig without an effect
GRAINS, DIAMETER_MM, SCATTER = 1800, 5.0, 0.05
YOUNG_MODULUS, DENSITY = 2e6, 2500.0  # [Pa], [kg/m3]
MASS_KG = GRAINS * math.pi / 6 * (1e-3 * DIAMETER_MM) ** 3 * DENSITY
MATERIAL = MaterialSettings(
    young_modulus_pa=YOUNG_MODULUS, poisson_ratio=0.25, density_kg_m3=DENSITY, friction_angle_deg=22
)
DURATION_MS = 1200.0
SAMPLES = 60
CHANNELS = ("discharged_fraction", "level", "level_left", "level_right")

# One strength each, about the middle of what is plausible.
STRENGTHS: Mapping[str, Values] = {
    NONE: {},
    "body_damping": {"share": 0.25},
    "drag_linear": {"rate": 5.0},
    "drag_quadratic": {"rate": 5.0},
    "tilt": {"angle": 0.15},
    "slow_gate": {"opening_time": 0.3},
    "two_sizes": {"small_share": 0.5, "small_ratio": 0.6},
    "grain_aspect": {"aspect": 1.5},
    "cohesion": {"energy": 0.15},
    "restitution": {"change": -0.4},
    "vibration": {"amplitude": 5e-4, "frequency": 30.0},
    "side_wall_friction": {"excess": 0.8},
    "rolling_resistance": {"coefficient": 0.1, "spring": 2.0},
}


@dataclass(frozen=True, slots=True)
class Task:
    """One run of the rig."""

    engine: str
    factor: float | None  # time step over r_min sqrt(density / E); None: the default
    effect: str
    seed: int


def main(arguments: Sequence[str] | None = None) -> int:
    """Run or report, as the command line says."""
    parser = argparse.ArgumentParser(prog="rig", description="the discharge rig on two engines")
    commands = parser.add_subparsers(required=True)
    run = commands.add_parser("run", help="run the rig")
    run.add_argument("--engine", required=True, choices=["numba", "yade"])
    run.add_argument("--factor", type=float)
    run.add_argument("--effects", nargs="+", default=[NONE], help="names, or all")
    run.add_argument("--seeds", nargs="+", required=True)
    run.add_argument("--out", type=Path, required=True)
    run.set_defaults(do=_run)
    told = commands.add_parser("report", help="compare the engines")
    told.add_argument("--in", dest="directory", type=Path, required=True)
    told.set_defaults(do=lambda given: print(report(curves_in(given.directory))) or 0)
    given = parser.parse_args(arguments)
    try:
        return int(given.do(given))
    except MfoptError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2


def _run(given: argparse.Namespace) -> int:
    effects = list(STRENGTHS) if given.effects == ["all"] else given.effects
    if given.engine != "numba":
        effects = [e for e in effects if e == NONE or given.engine in effect_named(e).engines]
    if unknown := sorted(set(effects) - set(STRENGTHS)):
        raise ConfigError(f"unknown effect {unknown[0]!r}; choose from {', '.join(STRENGTHS)}")
    path = given.out / f"{given.engine}.jsonl"
    there = {(line["factor"], line["effect"], line["seed"]) for _, line in lines.read(path)}
    for seed in seeds_of(given.seeds):
        for effect in effects:
            if (given.factor, effect, seed) not in there:
                made = run_once(Task(given.engine, given.factor, effect, seed))
                lines.append(path, made)
                shown = [made[k] for k in ("factor", "effect", "seed", "status", "why", "cpu_s")]
                print(*shown, flush=True)
    return 0


def run_once(task: Task) -> dict[str, object]:
    """Run the rig once; a failed run is a run too."""
    dem = DemSettings(
        grains=GRAINS,
        spheres_per_grain=1,
        young_modulus_pa=YOUNG_MODULUS,
        contact_law="hertz",
        restitution=0.7,
        damping=0.0,
        timestep_factor=task.factor if task.engine == "yade" else None,
        effects={} if task.effect == NONE else {task.effect: dict(STRENGTHS[task.effect])},
    )
    scene = Discharge(rig())
    level = SceneLevel("rig", scene, dem, _engine(task))
    outcome = level.evaluate(scene.problem().baseline, seed=task.seed)
    raw = outcome.raw
    return {
        "engine": task.engine, "factor": task.factor, "effect": task.effect, "seed": task.seed,
        "status": outcome.status, "why": outcome.why, "cpu_s": round(outcome.cpu_s, 2),
        "timestep": float(raw["timestep"]) if outcome.finished else None,
        **{c: [round(float(v), 5) for v in raw[c]] for c in CHANNELS if outcome.finished},
    }  # fmt: skip


def rig() -> Hopper:
    """The hopper and its beads."""
    return Hopper(
        length_mm=120, depth_mm=30, opening_mm=30, floor_mm=4, portion_kg=MASS_KG,
        grain_length_mm=DIAMETER_MM, grain_width_mm=DIAMETER_MM, size_scatter=SCATTER,
        grain=MATERIAL, wall=MATERIAL, duration_ms=DURATION_MS, samples=SAMPLES,
    )  # fmt: skip


def _engine(task: Task) -> Engine:
    if task.engine == "numba" and task.factor is not None:
        smallest = 0.5e-3 * DIAMETER_MM * (1.0 - SCATTER)
        return NumbaEngine(
            fixed_timestep=task.factor * smallest * math.sqrt(DENSITY / YOUNG_MODULUS)
        )
    return engine_named(task.engine)


def curves_in(directory: Path) -> list[Curves]:
    """The finished runs of a directory, grouped by engine, step and effect.

    Raises:
        ConfigError: if there are none.
    """
    runs = [line for path in lines.files_in(directory) for _, line in lines.read(path)]
    groups = sorted(
        {(r["engine"], r["factor"] or 0.0, r["effect"]) for r in runs if r["status"] == "finished"}
    )
    if not groups:
        raise ConfigError(f"{directory} holds no finished run of the rig; run it first")
    made = []
    for engine, factor, effect in groups:
        of = sorted(
            (
                r for r in runs
                if (r["engine"], r["factor"] or 0.0, r["effect"]) == (engine, factor, effect)
                and r["status"] == "finished"
            ),
            key=lambda r: r["seed"],
        )  # fmt: skip
        series = {c: np.array([r[c] for r in of]) for c in CHANNELS}
        seeds = tuple(r["seed"] for r in of)
        cpu_s = float(np.mean([r["cpu_s"] for r in of]))
        made.append(Curves(engine, factor, effect, seeds, series, cpu_s, of[0]["timestep"]))
    return made


if __name__ == "__main__":
    sys.exit(main())
