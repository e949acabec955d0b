"""Every scene that a study can name keeps the protocol of a scene."""

import dataclasses
import pickle
from pathlib import Path

import numpy as np
import pytest

from fidelity.engines.numba import NumbaEngine
from fidelity.grains.settings import DemSettings
from fidelity.level import SceneLevel
from fidelity.scene import Scene, read_scene
from mfopt.commands.init import template
from mfopt.errors import ConfigError
from mfopt.study.assemble import SCENES, assemble
from mfopt.study.file import read_study

COARSE = DemSettings(grains=150, spheres_per_grain=1, time_limit_s=60)
NAMES = list(SCENES)


def scene_named(name: str) -> Scene:
    return read_scene(SCENES[name], {}, {}, "study")


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("packings")


@pytest.mark.parametrize("name", NAMES)
def test_the_baseline_runs_and_gives_every_quantity(name: str, cache: Path) -> None:
    scene = scene_named(name)
    level = SceneLevel("coarse", scene, COARSE, NumbaEngine(), cache)
    x = scene.problem().baseline
    outcome = level.evaluate(x, seed=1)
    assert outcome.finished, outcome.why
    criteria = scene.criteria()
    asked = criteria.quantities_of(outcome)
    assert list(asked) == [q.name for q in criteria.quantities]
    assert np.isfinite(list(asked.values())).all()
    assert criteria.beside in asked
    for objective in criteria.objectives.values():
        terms = objective.terms(outcome.raw)
        assert np.isfinite(list(terms.values())).all()
        assert set(objective.constraints) <= set(terms)
    again = level.evaluate(x, seed=1)
    assert {n: a.tobytes() for n, a in again.raw.items() if not n.startswith("settling")} == {
        n: a.tobytes() for n, a in outcome.raw.items() if not n.startswith("settling")
    }


@pytest.mark.parametrize("name", NAMES)
def test_the_first_steps_can_be_run(name: str, cache: Path) -> None:
    scene = scene_named(name)
    level = SceneLevel("coarse", scene, COARSE, NumbaEngine(), cache)
    x = scene.problem().baseline
    part = level.probe(x, seed=1, share=0.02)
    assert part.finished, part.why
    assert 0.0 < part.work < 0.1 * level.work(x)


@pytest.mark.parametrize("name", NAMES)
def test_predicted_work_is_about_what_a_run_takes(name: str, cache: Path) -> None:
    scene = scene_named(name)
    level = SceneLevel("coarse", scene, COARSE, NumbaEngine(), cache)
    x = scene.problem().baseline
    assert level.evaluate(x, seed=2).work == pytest.approx(level.work(x), rel=0.7)


@pytest.mark.parametrize("name", NAMES)
def test_a_scene_can_be_sent_to_another_process(name: str) -> None:
    scene = scene_named(name)
    assert pickle.loads(pickle.dumps(scene)) == scene
    pickle.loads(pickle.dumps(scene.problem().constraint))


@pytest.mark.parametrize("name", NAMES)
def test_a_design_is_drawn(name: str) -> None:
    scene = scene_named(name)
    x = scene.problem().baseline
    view, meshes = scene.view(x, COARSE), scene.meshes(x)
    assert set(view.parts) == set(meshes)
    assert all(np.isfinite(mesh.vertices).all() for mesh in meshes.values())
    assert len(view.grain_radii) == 1


@pytest.mark.parametrize("name", NAMES)
def test_pictures_of_a_run_show_its_grains_and_change_nothing(name: str, cache: Path) -> None:
    scene = scene_named(name)
    level = SceneLevel("coarse", scene, COARSE, NumbaEngine(), cache)
    x = scene.problem().baseline
    plain = level.evaluate(x, seed=2).raw
    shown = dataclasses.replace(level, snapshots=3).evaluate(x, seed=2).raw
    assert shown["snapshot_positions"].shape == (3, COARSE.grains, 3)
    assert np.all(np.diff(shown["snapshot_times"]) > 0.0)
    for key in (k for k in plain if not k.startswith("settling")):  # of the first run alone
        np.testing.assert_array_equal(plain[key], shown[key])


@pytest.mark.parametrize("name", NAMES)
def test_one_picture_is_one_picture(name: str, cache: Path) -> None:
    scene = scene_named(name)
    level = SceneLevel("coarse", scene, COARSE, NumbaEngine(), cache, snapshots=1)
    shown = level.evaluate(scene.problem().baseline, seed=2).raw
    assert shown["snapshot_positions"].shape == (1, COARSE.grains, 3)


@pytest.mark.parametrize("name", NAMES)
def test_an_unknown_key_is_refused_by_name(name: str) -> None:
    with pytest.raises(ConfigError, match=f"problem.{name}: unknown key 'nothing'"):
        read_scene(SCENES[name], {"nothing": 1}, {}, "study")
    with pytest.raises(ConfigError, match="problem: unknown key 'nothing'"):
        read_scene(SCENES[name], {}, {"nothing": 1}, "study")


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("table", ["grain", "wall"])
def test_a_material_may_leave_out_what_is_usual(name: str, table: str) -> None:
    usual = getattr(scene_named(name).settings, table)
    own = {table: {"density_kg_m3": 1234.0}}
    changed = getattr(read_scene(SCENES[name], own, {}, "study").settings, table)
    assert changed == usual.model_copy(update={"density_kg_m3": 1234.0})
    with pytest.raises(ConfigError, match="did you mean 'density_kg_m3'"):
        read_scene(SCENES[name], {table: {"density": 1234.0}}, {}, "study")


@pytest.mark.parametrize("name", NAMES)
def test_its_commented_study_is_valid(name: str) -> None:
    study, _ = read_study(template(name))
    assert study.problem.scene == name
    parts = assemble(study, where="template")
    assert parts.problem.impossible(parts.problem.baseline) is None


@pytest.mark.parametrize("name", NAMES)
def test_what_an_engine_is_given_is_sound(name: str, cache: Path) -> None:
    scene = scene_named(name)
    level = SceneLevel("coarse", scene, COARSE, NumbaEngine(), cache, snapshots=3)
    setup, _ = level._start(scene.problem().baseline, 1)
    assert len(setup.packing.positions) == COARSE.grains
    assert np.all(setup.snapshot_times <= setup.duration)
