"""The scenes of the agreement campaign: one call runs a scene on an engine and tells its numbers.

The machines are those of a portion of 1 kg and stay the same for every number of grains: grains
become finer with their number, as in dosing.
"""

import importlib
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from benchmarks.engine.runs import Run
from fidelity.engine import Engine
from fidelity.grains.filling import Portion
from fidelity.grains.settings import RICE, DemSettings
from fidelity.level import SceneLevel
from fidelity.scene import Scene
from fidelity.scenes.discharge.run import DischargeSettings
from fidelity.scenes.discharge.scene import Discharge
from fidelity.scenes.discharge.settings import Hopper
from fidelity.scenes.discharge.settings import built as built_hopper
from fidelity.scenes.dosing.scene import Dosing
from fidelity.scenes.heap.scene import Cylinder, Heap
from fidelity.scenes.heap.scene import built as built_cylinder
from fidelity.scenes.silo.scene import Box, Silo
from fidelity.scenes.silo.scene import built as built_box
from mfopt.arrays import AnyArray, Array
from mfopt.errors import ConfigError
from mfopt.files.scratch import scratch

TIME_LIMIT_S = 7200.0  # of one run; far above what the largest takes
PORTION: Mapping[str, Any] = {  # as in dosing
    "portion_kg": 1, "grain_length_mm": 7, "grain_width_mm": 2, "grain": RICE
}  # fmt: skip
DISCHARGE, HEAP, SILO = "discharge", "heap", "silo"
SCENES: Mapping[str, Scene] = {
    # 1 kg fills 1.5 l at 40 % solid. The outlet is wide for coarse grains, 7.6 diameters of 300:
    # at 6 they arch now and then, and the rate scatters by 20 to 30 % between seeds, not 6 %.
    DISCHARGE: Discharge(
        Hopper(
            length_mm=180, depth_mm=100, opening_mm=120, floor_angle_deg=60, fall_mm=35,
            duration_ms=500, free={"opening": (100, 140)}, **PORTION,
        )
    ),
    HEAP: Heap(
        Cylinder(
            radius_mm=71, plate_mm=600, lift_speed_mm_s=250, lift_height_mm=100, rest_ms=300,
            **PORTION,
        )
    ),
    SILO: Silo(Box(width_mm=80, rest_ms=100, **PORTION)),  # filled to about 250 mm
}  # fmt: skip
# What is kept of a run, and what the scene calls it; all of a dosing run.
KEPT: Mapping[str, Mapping[str, str]] = {
    DISCHARGE: {
        "exit_times": "passage_times", "left": "left", "mass_flow_rate": "mass_flow_rate",
    },
    HEAP: {n: n for n in ("angle", "radius", "radii", "heights", "mean_height", "fallen")},
    SILO: {n: n for n in ("wall_share", "floor_share", "shares", "fill_height")},
}  # fmt: skip

ABSENT = ("floor", "bar", "bar_height")  # from the hopper; the runs that are kept do not name them
STEP = 0.6  # `timestep_factor` of the runs that are kept

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


def baseline_of(scene: Scene) -> Array:
    """The design (d,) of a machine as it is given."""
    return scene.problem().baseline


def hopper() -> DischargeSettings:
    """The hopper of the scene `discharge`, in SI units."""
    scene = SCENES[DISCHARGE]
    assert isinstance(scene, Discharge)
    return built_hopper(scene.settings, baseline_of(scene))


def portion_of(grains: int) -> Portion:
    """The portion of 1 kg in so many grains."""
    scene = SCENES[DISCHARGE]
    return scene.portion(baseline_of(scene), DemSettings(grains=grains, timestep_factor=STEP))


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


def run_scene(engine_name: str, name: str, grains: int, seed: int) -> Run:
    """Run a scene once; a failed run is a run too."""
    engine = engine_named(engine_name)
    kind, _, design = name.partition(":")
    scene = SCENES.get(kind, Dosing())
    problem, dem = (
        scene.problem(),
        DemSettings(grains=grains, timestep_factor=STEP, time_limit_s=TIME_LIMIT_S),
    )
    values = {**problem.named(problem.baseline), **DESIGNS.get(design, {})}
    # Each engine settles its own portion: the whole way to a result is compared.
    with scratch() as cache:
        level = SceneLevel(kind, scene, dem, engine, cache, filler=engine)
        outcome = level.evaluate(np.array(list(values.values())), seed=seed)
    raw: Mapping[str, AnyArray] = outcome.raw
    settings, work, cpu_s = _settings(kind, grains), outcome.work, outcome.cpu_s
    if outcome.finished and kind in KEPT:  # a dosing run names its settling, and keeps all
        work += float(raw["settling_work"])
        cpu_s += float(raw["settling_cpu_s"])
        raw = {stored: raw[called] for stored, called in KEPT[kind].items()}
        raw |= {"grain_mass": np.asarray(settings["grain_mass"])} if kind == DISCHARGE else {}
    return Run(
        engine=engine_name,
        scene=name,
        grains=grains,
        seed=seed,
        status=outcome.status,
        why=outcome.why,
        raw=raw,
        work=work,
        cpu_s=cpu_s,
        settings=settings,
    )


def _settings(kind: str, grains: int) -> dict[str, Any]:
    """What a run of the scene depends on besides engine and seed, as JSON gives it back."""
    if kind not in SCENES:
        return {}
    portion = portion_of(grains)
    return {
        **_machine(SCENES[kind]),
        "young_modulus": portion.grain_material.young_modulus,
        "damping": portion.physics.damping,
        "grain_mass": portion.grain.mass,
    }


def _machine(scene: Scene) -> dict[str, Any]:
    """Measures of a machine, SI units."""
    match scene:
        case Heap():
            machine = asdict(built_cylinder(scene.settings, baseline_of(scene)))
            return {name: round(value, 9) for name, value in machine.items()}  # 0.071 m, not more
        case Silo():
            return asdict(built_box(scene.settings, baseline_of(scene)))
    machine = asdict(hopper())
    return {name: value for name, value in machine.items() if name not in ABSENT}
