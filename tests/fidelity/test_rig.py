"""Every scene is a rig: its settings are conditions, its grains have their real size."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from toy_scene import Ramp

from fidelity.engines.numba import NumbaEngine
from fidelity.level import SceneLevel
from fidelity.rig import RigLevel, SceneRig
from fidelity.scene import PortionSettings
from mfopt.errors import ConfigError
from mfopt.records.outcome import Outcome
from mfopt.study.assemble import SCENES

ROUGH = {"spheres_per_grain": 1, "young_modulus_pa": 2e5}
# So coarse that a portion of each scene has about 100 grains.
COARSE = {"dosing": 12.0, "discharge": 2.5, "heap": 2.5, "silo": 4.0}


def rig(scene: str = "dosing", tables: Mapping[str, Any] | None = None, **more: Any) -> SceneRig:
    given = {"grains": {}, "numerics": ROUGH, "engine": NumbaEngine(), "coarse": COARSE[scene]}
    return SceneRig(SCENES, scene, {scene: {}} | (tables or {}), **(given | more))


def level(its: SceneRig, conditions: Mapping[str, float | str], *parameters: str) -> RigLevel:
    return its.level("level", conditions, parameters)


def of_settings(its: SceneLevel) -> PortionSettings:
    assert isinstance(its.scene.settings, PortionSettings)
    return its.scene.settings


def test_values_that_exclude_each_other_are_a_failed_run() -> None:
    its = level(rig("discharge"), {}, "friction", "side_wall_friction")
    outcome = its.evaluate(np.array([0.1, -0.3]), seed=1)
    assert outcome.status == "invalid_design"
    assert outcome.why is not None
    assert "excess = -0.3 must be at least -0.1" in outcome.why


@pytest.mark.parametrize("scene", SCENES)
def test_a_run_of_every_scene_gives_the_channels_that_the_rig_names(scene: str) -> None:
    its = rig(scene)
    outcome = level(its, {}, "friction").evaluate(np.array([0.3]), seed=1)
    assert outcome.finished, outcome.why
    assert {*outcome.raw} - {"time"} == {*its.channels}
    for name, channel in its.channels.items():
        values = outcome.raw[name]
        assert np.all(np.abs(values) <= 3.0 * channel.size), name
        assert values.shape in ((), outcome.raw.get("time", values).shape), name


def test_nothing_may_be_left_in_a_cup_or_hopper() -> None:
    for scene in ("dosing", "discharge"):
        assert [c.name for c in rig(scene).channels.values() if c.can_vanish] == ["mass_left"]


@pytest.fixture(scope="module")
def passages() -> dict[float, Outcome]:
    """A cup of grains on walls of two frictions."""
    made = level(rig(), {}, "wall_friction")
    return {mu: made.evaluate(np.array([mu]), seed=2) for mu in (0.05, 0.5)}


def test_the_passage_curve_of_a_cup_rises_to_what_is_not_left(
    passages: Mapping[float, Outcome],
) -> None:
    for outcome in passages.values():
        share = outcome.raw["share_passed"]
        assert np.all(np.diff(outcome.raw["time"]) >= 0.0)
        assert np.all(np.diff(share) >= 0.0)
        assert share[0] == 0.0
        assert share[-1] == pytest.approx(1.0 - outcome.raw["mass_left"])


def test_rougher_walls_let_the_grains_pass_later(passages: Mapping[float, Outcome]) -> None:
    smooth, rough = (np.median(o.raw["time"]) for o in passages.values())
    assert 0.01 < rough - smooth < 0.1


def test_conditions_are_settings_design_values_and_keys_of_tables() -> None:
    conditions = {"cycle_ms": 700.0, "stroke_mm": 380.0, "values.v": 1.2, "cup.volume_ml": 1400.0}
    made = level(rig(), conditions, "friction").scene(np.array([0.3]))
    assert made.scene.cycle(made.scene.problem().baseline).duration_s == pytest.approx(0.7)
    its = of_settings(made)
    assert its.all_values()["v"] == 1.2
    told = its.model_dump()
    assert (told["stroke_mm"], told["cup"]) == (
        380.0, {"length_mm": 130.0, "width_mm": 100.0, "radius_mm": 20.0, "volume_ml": 1400.0},
    )  # fmt: skip


def test_grains_keep_their_size_whatever_the_portion() -> None:
    its = rig(numerics={"spheres_per_grain": 5}, coarse=6.0)
    whole, half = (
        level(its, {"portion_kg": kg}, "friction").scene(np.array([0.3])) for kg in (1.0, 0.5)
    )
    assert whole.dem.grains == pytest.approx(2 * half.dem.grains, abs=1)
    for made in (whole, half):
        grain = made.scene.portion(made.scene.problem().baseline, made.dem).grain
        length = np.ptp(grain.offsets[:, 0]) + 2 * grain.radii[0]
        assert 1e3 * length == pytest.approx(6.0 * 7.0, rel=0.01)


def test_parameters_reach_grains_and_all_walls_of_the_machine() -> None:
    made = level(rig(), {}, "friction", "wall_friction").scene(np.array([0.9, 0.6]))
    x, scene = made.scene.problem().baseline, made.scene
    portion = scene.portion(x, made.dem)
    assert math.tan(portion.grain_material.friction_angle) == pytest.approx(0.9)
    assert portion.wall_friction_angle is not None
    assert math.tan(portion.wall_friction_angle) == pytest.approx(0.6)
    filling = scene.filling(x, made.dem, 1)
    assert filling is not None
    packing = filling.settle(NumbaEngine(), 60.0).packing
    walls = scene.setup(x, made.dem, packing, 1, 0).walls
    assert [wall.name for wall in walls] == ["cup", "plate", "hopper", "housing"]
    assert {wall.friction_angle for wall in walls} == {portion.wall_friction_angle}


def test_the_bounds_of_a_search_do_not_limit_a_rig() -> None:
    its = rig(tables={"dosing": {"values": {"l1": 200.0, "v": 5.0}, "free": {"v": (0.2, 4.0)}}})
    made = level(its, {}, "friction").scene(np.array([0.3]))
    assert of_settings(made).all_values()["l1"] == 200.0
    assert of_settings(made).all_values()["v"] == 5.0


@pytest.mark.parametrize("given", ["of the scene", "of all scenes"])
def test_another_scene_has_the_same_grains(given: str) -> None:
    light = {"grain": {"density_kg_m3": 1400.0}, "grain_width_mm": 3.0}
    more = {"tables": {"dosing": light}} if given == "of the scene" else {"grains": light}
    its = rig(coarse=5.0, **more)
    cup, heap = (
        of_settings(level(its, {"scene": scene}, "restitution").scene(np.array([0.3])))
        for scene in ("dosing", "heap")
    )
    assert (heap.grain_length_mm, heap.grain_width_mm) == (7.0, 3.0)
    assert heap.grain == cup.grain  # rice, where nothing else is said
    assert heap.grain.density_kg_m3 == 1400.0
    assert heap.portion_kg == 0.25


def test_another_scene_may_have_other_grains() -> None:
    its = rig(coarse=5.0, tables={"heap": {"grain_width_mm": 4.0}})
    heap = of_settings(level(its, {"scene": "heap"}, "friction").scene(np.array([0.3])))
    assert (heap.grain_length_mm, heap.grain_width_mm) == (7.0, 4.0)


def test_every_scene_proposes_experiments_of_its_own() -> None:
    assert rig().possible == {
        "portion_kg = 0.5": {"portion_kg": 0.5},
        "cycle_ms = 900": {"cycle_ms": 900.0},
        "a heap": {"scene": "heap"},
    }
    assert [*rig("discharge").possible] == [
        "portion_kg = 0.125", "opening_mm = 24", "opening_mm = 42", "a heap"
    ]  # fmt: skip
    assert [*rig("heap").possible] == ["portion_kg = 0.125"]


@pytest.mark.parametrize(
    ("conditions", "more", "said"),
    [
        ({"cycle": 700.0}, {}, "unknown key 'cycle'; did you mean 'cycle_ms'"),
        ({"values.vv": 1.0}, {}, "unknown design parameter 'vv'; did you mean 'v'"),
        ({"cup.volume": 900.0}, {}, "unknown key 'cup.volume'; did you mean 'volume_ml'"),
        ({"portion_kg.x": 1.0}, {}, "portion_kg = {'x': 1.0} must be a number"),
        ({"portion_kg": 2.0}, {}, "no poured portion is denser than 64%; give the cup at least"),
        ({"cycle_ms": 1500.0}, {}, "duration_ms = 1200 must be at least cycle_ms = 1500"),
        ({"cup.radius_mm": 60.0}, {}, "the cup cannot be built"),
        ({"values.r1": 90.0}, {}, "section 1: radius = 90 mm must not exceed half the shorter"),
        ({}, {"coarse": 1.0}, "portion_kg = 1 is 149894 grains, which must be 20 to 100000"),
        ({"portion_kg": 0.1}, {}, "is 9 grains, which must be 20 to 100000; change the portion"),
        ({}, {"grains": {"size_scatter": 0.1}}, "unknown key 'size_scatter'"),
        ({}, {"numerics": {"effects": {"grain_aspect": {"aspect": 2.0}}}},
         "the scene dosing lacks the effect 'grain_aspect'"),
        ({"scene": "dozing"}, {}, "there is no scene 'dozing'; did you mean 'dosing'"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(
    conditions: Mapping[str, float | str], more: Mapping[str, Any], said: str
) -> None:
    with pytest.raises(ConfigError) as error:
        level(rig(**more), conditions, "friction")
    assert said in str(error.value)


def test_a_scene_without_a_portion_cannot_be_calibrated() -> None:
    its = SceneRig({"ramp": Ramp}, "ramp", {}, {}, {}, NumbaEngine())
    with pytest.raises(ConfigError, match="'ramp' cannot be calibrated: its settings have no port"):
        _ = its.channels


def test_a_table_of_a_scene_changes_single_values_of_the_grains() -> None:
    tables = {"discharge": {"grain": {"density_kg_m3": 1200.0}}}
    grains = {"grain": {"density_kg_m3": 1500.0, "friction_angle_deg": 25.0}}
    grain = level(rig("discharge", tables, grains=grains), {}).settings["grain"]
    assert (grain["density_kg_m3"], grain["friction_angle_deg"]) == (1200.0, 25.0)


def test_grains_that_may_jam_are_said() -> None:
    (said,) = rig("discharge", coarse=3.0).doubts({"opening_mm": 30.0})
    assert "outlet of 30 mm is 2.0 simulated grains of 15 mm wide" in said
    assert "give a smaller `coarse`" in said
    assert rig("discharge", coarse=1.0).doubts({"opening_mm": 30.0}) == ()
    assert rig("discharge", coarse=3.0).doubts({"scene": "heap"}) == ()
    assert "the outlet of 70 mm" in rig("dosing", coarse=12.0).doubts({})[0]
