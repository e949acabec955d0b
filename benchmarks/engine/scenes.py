"""The scenes of the agreement campaign: one call runs a scene on an engine and tells its numbers.

The machines are those of a portion of 1 kg and stay the same for every number of grains: grains
become finer with their number, as in dosing.
"""

import importlib
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from benchmarks.engine.runs import Run
from fidelity.engine import Engine, Movement, Physics
from fidelity.grains.filling import Portion, filled
from fidelity.grains.grain import portion_grain
from fidelity.grains.settings import RICE, STEEL, DemSettings
from fidelity.level import SceneLevel
from fidelity.scenes.discharge import run as discharge
from fidelity.scenes.discharge.run import DischargeSettings
from fidelity.scenes.dosing.design import dosing_problem
from fidelity.scenes.dosing.scene import Dosing
from fidelity.scenes.dosing.settings import DosingSettings
from fidelity.scenes.heap import run as heap
from fidelity.scenes.heap.run import HeapSettings
from fidelity.scenes.silo import run as silo
from fidelity.scenes.silo.run import SiloSettings
from mfopt.arrays import AnyArray
from mfopt.errors import ConfigError, SimulationError
from mfopt.records.outcome import Status

TIME_LIMIT_S = 7200.0  # of one run; far above what the largest takes
PORTION_KG = 1.0
GRAIN_LENGTH, GRAIN_WIDTH, SPHERES = 7e-3, 2e-3, 5  # [m], [m], -: unscaled, as in dosing
YOUNG_MODULUS = 1e6  # [Pa] of the middle levels
DAMPING = 0.125  # [-] as in dosing

# 1 kg fills 1.5 l at 40 % solid. The outlet is wide for coarse grains, 7.6 diameters of 300: at
# 6 they arch now and then, and the rate scatters by 20 to 30 % between seeds instead of 6 %.
HOPPER = DischargeSettings(
    length=0.18,
    depth=0.10,
    opening=0.12,
    floor_angle=math.radians(60),
    fall=0.035,
    duration=0.5,
)
HEAP = HeapSettings(radius=0.071, plate=0.60, lift_speed=0.25, lift_height=0.10, rest=0.3)
SILO = SiloSettings(width=0.080)  # filled to about 250 mm

# The baseline and three designs that differ in hopper or motion, all but the first emptying
# the cup; values over those of the baseline [mm, -].
DESIGNS: Mapping[str, Mapping[str, float]] = {
    "baseline": {},
    "slow-end": {"x1": 0.3, "y1": 0.4, "x2": 0.7, "y2": 0.5, "v": 1.2},
    "wide": {
        "l1": 165, "w1": 130, "r1": 30, "s1": 0, "l2": 120, "w2": 90, "r2": 25, "s2": 0,
        "x1": 0.2, "y1": 0.35, "x2": 0.7, "y2": 0.55, "v": 1.5,
    },
    "shifted": {
        "l1": 140, "w1": 95, "r1": 20, "s1": 20, "l2": 110, "w2": 75, "r2": 20, "s2": 10,
        "x1": 0.3, "y1": 0.45, "x2": 0.7, "y2": 0.6, "v": 1.2,
    },
}  # fmt: skip

ENGINES: Mapping[str, tuple[str, str]] = {
    "yade": ("fidelity.engines.yade.engine", "YadeEngine"),
    "numba": ("fidelity.engines.numba", "NumbaEngine"),
    "bullet": ("fidelity.engines.bullet.engine", "BulletEngine"),
}

Told = tuple[Mapping[str, AnyArray], tuple[Movement, ...]]  # numbers, and what they cost
Scene = Callable[[Engine, Portion, int], Told]


def engine_named(name: str) -> Engine:
    """Make the engine of that name; only its module is imported.

    Raises:
        ConfigError: if there is none.
    """
    if name not in ENGINES:
        raise ConfigError(f"unknown engine {name!r}; choose from {', '.join(ENGINES)}")
    module, kind = ENGINES[name]
    engine: Engine = getattr(importlib.import_module(module), kind)()
    return engine


def portion_of(grains: int) -> Portion:
    """The portion of 1 kg in so many grains."""
    material = RICE.material(YOUNG_MODULUS)
    grain = portion_grain(
        mass=PORTION_KG,
        density=material.density,
        length=GRAIN_LENGTH,
        width=GRAIN_WIDTH,
        grains=grains,
        spheres=SPHERES,
    )
    return Portion(grain, grains, material, STEEL.material(), Physics(damping=DAMPING))


def run_discharge(engine: Engine, portion: Portion, seed: int) -> Told:
    """Fill the hopper and let it run out."""
    filling = discharge.filling_setup(HOPPER, portion, seed)
    packing, raining = filled(engine, filling, time_limit_s=TIME_LIMIT_S)
    setup = discharge.discharge_setup(HOPPER, portion, packing)
    flowing = _done(engine.move(setup, time_limit_s=TIME_LIMIT_S))
    told = discharge.discharge_result(HOPPER, portion, flowing)
    if told.lost:
        raise SimulationError(f"{told.lost} grains got out beside the outlet")
    numbers = {
        "exit_times": told.times,
        "grain_mass": np.asarray(told.grain_mass),
        "left": np.asarray(told.left),
        "mass_flow_rate": np.asarray(told.mass_flow_rate),
    }
    return numbers, (raining, flowing)


def run_heap(engine: Engine, portion: Portion, seed: int) -> Told:
    """Fill the cylinder and lift it."""
    filling = heap.filling_setup(HEAP, portion, seed)
    packing, raining = filled(engine, filling, time_limit_s=TIME_LIMIT_S)
    setup = heap.heap_setup(HEAP, portion, packing)
    lifting = _done(engine.move(setup, time_limit_s=TIME_LIMIT_S))
    told = heap.heap_result(portion.grain, lifting)
    numbers = {
        "angle": np.asarray(told.angle),
        "radius": np.asarray(told.radius),
        "radii": told.radii,
        "heights": told.heights,
        "mean_height": np.asarray(told.mean_height),
        "fallen": np.asarray(told.fallen),
    }
    return numbers, (raining, lifting)


def run_silo(engine: Engine, portion: Portion, seed: int) -> Told:
    """Fill the silo and let it rest."""
    setup = silo.silo_setup(SILO, portion, seed)
    movement = _done(engine.move(setup, time_limit_s=TIME_LIMIT_S))
    told = silo.silo_load(portion, movement)
    numbers = {
        "wall_share": np.asarray(told.wall_share),
        "floor_share": np.asarray(told.floor_share),
        "shares": told.shares,
        "fill_height": np.asarray(told.fill_height),
    }
    return numbers, (movement,)


SCENES: Mapping[str, Scene] = {"discharge": run_discharge, "heap": run_heap, "silo": run_silo}


def _done(movement: Movement) -> Movement:
    if movement.status != "finished":
        raise SimulationError(movement.why or movement.status)
    return movement


def scene_names(names: list[str]) -> list[str]:
    """Scenes as given, with `dosing` spelled out into its designs.

    Raises:
        ConfigError: if there is none of that name.
    """
    dosing = [f"dosing:{design}" for design in DESIGNS]
    known = [*SCENES, *dosing]
    spelled = [full for name in names for full in (dosing if name == "dosing" else [name])]
    for name in spelled:
        if name not in known:
            raise ConfigError(f"unknown scene {name!r}; choose from {', '.join(known)}, dosing")
    return spelled


def run_scene(engine_name: str, scene: str, grains: int, seed: int) -> Run:
    """Run a scene once; a failed run is a run too."""
    engine = engine_named(engine_name)
    if scene.startswith("dosing:"):
        return _run_dosing(engine, engine_name, scene, grains, seed)
    portion = portion_of(grains)
    raw: Mapping[str, AnyArray] = {}
    status: Status = "finished"
    why: str | None = None
    cost: tuple[Movement, ...] = ()
    try:
        raw, cost = SCENES[scene](engine, portion, seed)
    except SimulationError as error:
        status, why = "crashed", str(error)
    return Run(
        engine=engine_name,
        scene=scene,
        grains=grains,
        seed=seed,
        status=status,
        why=why,
        raw=raw,
        work=sum(m.sphere_steps for m in cost) * engine.cost_factor,
        cpu_s=sum(m.cpu_s for m in cost),
        settings=_settings(scene, portion),
    )


def _settings(scene: str, portion: Portion) -> dict[str, Any]:
    """What a run of the scene depends on besides engine and seed, as JSON gives it back."""
    machines = {
        "discharge": asdict(HOPPER),
        "heap": asdict(HEAP),
        "silo": asdict(SILO),
    }
    return {
        **machines[scene],
        "young_modulus": portion.grain_material.young_modulus,
        "damping": portion.physics.damping,
        "grain_mass": portion.grain.mass,
    }


def _run_dosing(engine: Engine, engine_name: str, scene: str, grains: int, seed: int) -> Run:
    settings = DosingSettings()
    problem = dosing_problem(settings)
    values = dict(zip(problem.names, map(float, problem.baseline), strict=True))
    values.update(DESIGNS[scene.partition(":")[2]])
    # Each engine settles its own portion: the whole way to a result is compared.
    dem = DemSettings(grains=grains)
    level = SceneLevel("dosing", Dosing(settings), dem, engine, filler=engine)
    outcome = level.evaluate(np.array([values[name] for name in problem.names]), seed=seed)
    return Run(
        engine=engine_name,
        scene=scene,
        grains=grains,
        seed=seed,
        status=outcome.status,
        why=outcome.why,
        raw=outcome.raw,
        work=outcome.work,
        cpu_s=outcome.cpu_s,
    )
