"""Effects of a level act on its scene: on the grains, on the filling and on the run."""

import math
from typing import Any

import numpy as np
import pytest

import mfopt
from fidelity.engines.bullet.engine import BulletEngine
from fidelity.grains.filling import Rained
from fidelity.grains.settings import DemSettings
from fidelity.level import SceneLevel
from fidelity.scenes.discharge.scene import Discharge
from fidelity.scenes.discharge.settings import Hopper
from mfopt.errors import ConfigError, SimulationError
from mfopt.study.load_scene import SceneRun

NULLS: dict[str, dict[str, float]] = {
    "rolling_resistance": {}, "cohesion": {}, "drag_linear": {}, "tilt": {}, "slow_gate": {},
    "two_sizes": {}, "vibration": {},
}  # fmt: skip


def run(scene: str = "discharge", **numerics: Any) -> SceneRun:
    its = mfopt.load_scene(scene)
    wide = {"opening": 60.0} if scene == "discharge" else {}  # grains do not jam there
    return its.run(wide, grains=150, spheres_per_grain=1, **numerics)


@pytest.fixture(scope="module")
def plain() -> SceneRun:
    return run()


def test_at_null_no_bit_of_a_discharge_changes(plain: SceneRun) -> None:
    null = run(effects=NULLS)
    for name, values in plain.outcome.raw.items():
        if not name.startswith("settling"):
            assert values.tobytes() == null.outcome.raw[name].tobytes(), name


def half_time(its: SceneRun) -> float:
    times, fraction = its.series["discharged fraction"]
    return float(np.interp(0.5, fraction, times))


def test_a_slow_gate_delays_the_discharge_by_about_half_its_time(plain: SceneRun) -> None:
    slow = run(effects={"slow_gate": {"opening_time": 0.4}})
    assert 0.1 < half_time(slow) - half_time(plain) < 0.5


def test_rolling_resistance_holds_more_grains_back(plain: SceneRun) -> None:
    rough = run(effects={"rolling_resistance": {"coefficient": 0.3}})
    assert rough.quantities["mass left"] > plain.quantities["mass left"]


def test_two_sizes_keep_the_mass_and_reach_the_outcome() -> None:
    mixed = run(effects={"two_sizes": {"small_share": 0.5, "small_ratio": 0.6}})
    assert mixed.outcome.raw["grains"] == 150
    assert mixed.quantities["mass flow rate"] > 0.0


def test_what_an_engine_or_scene_lacks_is_refused() -> None:
    dem = DemSettings(grains=50, spheres_per_grain=1, effects={"tilt": {"angle": 0.1}})
    with pytest.raises(ConfigError, match="engine bullet: it lacks the effect 'tilt'"):
        SceneLevel("l", Discharge(), dem, BulletEngine())
    with pytest.raises(ConfigError, match="unknown effect 'tilted'"):
        run(effects={"tilted": {"angle": 0.1}})
    with pytest.raises(ConfigError, match="dosing lacks the effect 'grain_aspect'"):
        run("dosing", effects={"grain_aspect": {"aspect": 2.0}})


def test_grains_below_the_top_of_a_thick_floor_have_not_left() -> None:
    # A slot 20 mm deep holds 120 grains more than none: they count once they are below it.
    thick = mfopt.load_scene("discharge", floor_mm=20).run(grains=150, spheres_per_grain=1)
    thin = run()
    level = {name: its.series["level"][1][0] for name, its in (("a", thick), ("b", thin))}
    assert level["a"] - level["b"] == pytest.approx(0.020 * (1.0 - 30.0 / 120.0), abs=0.004)
    assert thick.outcome.raw["lost"] == 0.0


def test_walls_have_the_friction_that_the_study_gives() -> None:
    dem = DemSettings(grains=50, spheres_per_grain=1)
    scene = Discharge(Hopper(wall_friction_angle_deg=60))
    rained = scene.filling(scene.problem().baseline, dem, seed=1).setup
    assert {wall.name: wall.friction_angle for wall in rained.walls} == {
        "hopper": pytest.approx(math.radians(60)),
        "gate": pytest.approx(math.radians(60)),
    }


def test_sizes_that_scatter_stay_from_the_filling_to_the_outcome() -> None:
    its = mfopt.load_scene("discharge", size_scatter=0.3)
    dem = DemSettings(grains=50, spheres_per_grain=1)
    rained = its.scene.filling(its.scene.problem().baseline, dem, seed=1)
    assert isinstance(rained, Rained)
    scales = rained.setup.packing.scales
    assert scales is not None
    assert scales.max() / scales.min() > 1.5
    assert np.mean(scales**3) == pytest.approx(1.0)
    run = its.run(grains=50, spheres_per_grain=1)
    passed = len(run.outcome.raw["passage_times"])
    assert passed + run.outcome.raw["left"] + run.outcome.raw["lost"] == 50


@pytest.mark.parametrize("scene", ["discharge", "heap", "silo"])
def test_a_grain_larger_than_the_vessel_is_a_failed_run_that_says_so(scene: str) -> None:
    its = mfopt.load_scene(scene, portion_kg=2.0)
    with pytest.raises(SimulationError, match="does not fit into the vessel"):
        its.run(grains=1, spheres_per_grain=1)


def test_the_widest_scatter_of_sizes_fills_the_hopper() -> None:
    its = mfopt.load_scene("discharge", size_scatter=0.5)
    assert its.run(grains=200, spheres_per_grain=1).quantities["mass flow rate"] > 0.0
