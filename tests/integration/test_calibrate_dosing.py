"""A cup of coarse rice is calibrated by its passage curve; a study takes the result."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from fidelity.engines.numba import NumbaEngine
from fidelity.level import SceneLevel
from fidelity.rig import RigLevel, SceneRig
from mfopt.commands.app import app
from mfopt.study.assemble import SCENES, assemble
from mfopt.study.material import read_with_material

TRUTH = {"friction": 0.5, "wall_friction": 0.25}
NUMERICS = {"spheres_per_grain": 1, "young_modulus_pa": 2e5}
CASE = """
[case]
name = "cup"
[rig]
scene = "dosing"
coarse = 10
stiffness_factor = 1
level = { spheres_per_grain = 1, young_modulus_pa = 2e5 }
[parameters.friction]
range = [0.1, 1.0]
[parameters.wall_friction]
range = [0.05, 0.7]
[measurement.share_passed]
noise = 0.005
[[recording]]
name = "cup"
conditions = { cycle_ms = 650, values.v = 1.4 }
files = ["cup-1.csv", "cup-2.csv"]
"""
STUDY = """
material = "run/material.toml"
[study]
name = "rice"
[problem]
scene = "dosing"
objective = "dispersion"
[problem.dosing]
grain = { young_modulus_pa = 1e8, poisson_ratio = 0.2, density_kg_m3 = 1592.67 }
[[level]]
name = "target"
engine = "numba"
grains = 150
spheres_per_grain = 1
contact_law = "hertz"
damping = 0
restitution = 0.7
young_modulus_pa = 2e5
[search]
budget = 1
"""


def recorded(level: RigLevel, seed: int) -> str:
    """A file of a run with the true parameters, with the errors of reading a scale."""
    raw = level.evaluate(np.array([*TRUTH.values()]), seed=seed).raw
    times = np.arange(0.0, 1.0, 0.02)
    share = np.interp(times, raw["time"], raw["share_passed"])
    share += 0.005 * np.random.default_rng(seed).normal(size=times.size)
    rows = (f"{1e3 * t:.0f},{1e2 * value:.2f}\n" for t, value in zip(times, share, strict=True))
    return "time [ms],share_passed [%]\n" + "".join(rows)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("cup")
    path = folder / "case.toml"
    path.write_text(CASE)
    rig = SceneRig(SCENES, "dosing", {"dosing": {}}, {}, NUMERICS, NumbaEngine(), 10.0)
    level = rig.level("cup", {"cycle_ms": 650, "values.v": 1.4}, tuple(TRUTH))
    for number in (1, 2):
        (folder / f"cup-{number}.csv").write_text(recorded(level, 1000 + number))
    given = ["calibrate", str(path), "-d", str(folder / "run"), "--runs", "28", "--workers", "1"]
    result = CliRunner().invoke(app, given)
    assert result.exit_code == 0, result.output
    return folder


def test_the_curve_tells_the_friction_of_the_walls(folder: Path) -> None:
    told = json.loads((folder / "run" / "calibration.json").read_text())
    friction, on_walls = told["parameters"]
    assert told["fits"]
    assert on_walls["determined"]
    for parameter, truth in ((friction, TRUTH["friction"]), (on_walls, TRUTH["wall_friction"])):
        low, high = parameter["interval"]
        assert low < truth < high


def test_the_report_draws_the_best_fit(folder: Path) -> None:
    page = (folder / "run" / "report.html").read_text()
    assert "The best fit at work" in page
    assert "cycle_ms = 650, values.v = 1.4" in page
    assert (folder / "run" / "best-fit-0.svg").read_text().count("<image") >= 2


def test_a_study_of_dosing_takes_the_material(folder: Path) -> None:
    (folder / "study.toml").write_text(STUDY)
    made, _, taken = read_with_material(folder / "study.toml")
    assert taken is not None
    level = assemble(made, where="study").ladder.top
    assert isinstance(level, SceneLevel)
    portion = level.scene.portion(level.scene.problem().baseline, level.dem)
    value = taken.material.values["wall_friction"].value
    assert portion.wall_friction_angle == pytest.approx(np.arctan(value))
