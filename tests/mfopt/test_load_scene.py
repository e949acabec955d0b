"""Single simulations from a notebook."""

import io
import re
from typing import Any

import numpy as np
import pytest

import mfopt
from mfopt.errors import ConfigError, SimulationError
from mfopt.study.load_scene import SceneRun


@pytest.fixture(scope="module")
def run() -> SceneRun:
    hopper = mfopt.load_scene("discharge", opening_mm=40, samples=50)
    return hopper.run(grains=150, spheres_per_grain=1)


def test_a_run_prints_its_quantities_in_a_few_lines(run: SceneRun) -> None:
    lines = repr(run).splitlines()
    assert len(lines) == 2 + len(run.quantities)
    assert lines[1].startswith("mass flow rate: ")
    assert lines[1].endswith(" g/s")


def test_a_run_takes_what_a_level_says_to_one_engine_alone() -> None:
    hopper = mfopt.load_scene("discharge")
    with pytest.raises(ConfigError, match="precision = 'half'"):
        hopper.run(engine="yade", precision="half")


def test_series_run_from_a_full_hopper_to_an_emptier_one(run: SceneRun) -> None:
    times, fraction = run.series["discharged fraction"]
    _, level = run.series["level"]
    assert times.shape == fraction.shape == level.shape == (51,)
    assert fraction[0] == 0.0
    assert (np.diff(fraction) >= 0.0).all()
    assert fraction[-1] == pytest.approx(1.0 - run.quantities["mass left"], abs=0.02)
    assert level[-1] < level[0]


def test_a_run_becomes_a_frame_and_a_figure(run: SceneRun) -> None:
    frame = run.frame()
    assert list(frame.columns) == list(run.series)
    assert frame.index.name == "time [s]"
    assert np.array_equal(frame["level"].to_numpy(), run.series["level"][1])
    page = io.BytesIO()
    run.plot().savefig(page)
    assert page.getbuffer().nbytes > 10_000


def test_a_design_changes_the_run(run: SceneRun) -> None:
    hopper = mfopt.load_scene("discharge", opening_mm=40)
    steep = hopper.run({"floor_angle": 60.0}, grains=150, spheres_per_grain=1)
    assert steep.quantities["mass left"] < run.quantities["mass left"]


def test_no_bounds_of_a_search_limit_a_single_run() -> None:
    wide = mfopt.load_scene("discharge", opening_mm=100)
    assert "opening = 100 mm" in repr(wide)


def test_what_cannot_be_built_is_refused_when_it_is_loaded() -> None:
    with pytest.raises(ConfigError, match=r"opening = 150 mm .* narrow the outlet"):
        mfopt.load_scene("discharge", opening_mm=150)


def test_a_scene_without_quantities_over_time_says_so() -> None:
    silo = mfopt.load_scene("silo").run(grains=60, spheres_per_grain=1)
    for ask in (silo.plot, silo.frame):
        with pytest.raises(ConfigError, match="silo has no quantities over time"):
            ask()


def test_dosing_has_its_passage_curve() -> None:
    its = mfopt.load_scene("dosing").run(grains=60, spheres_per_grain=1)
    times, share = its.series["share passed"]
    assert share[0] == 0.0
    assert share[-1] == pytest.approx(1.0 - its.quantities["mass left"])
    assert (np.diff(times) >= 0.0).all()


def test_wrong_arguments_are_named() -> None:
    with pytest.raises(ConfigError, match="no scene 'discharges'; did you mean 'discharge'"):
        mfopt.load_scene("discharges")
    with pytest.raises(ConfigError, match="unknown key 'opening'"):
        mfopt.load_scene("discharge", opening=4)
    hopper = mfopt.load_scene("discharge")
    with pytest.raises(ConfigError, match="no variable 'openin'"):
        hopper.run({"openin": 3.0})
    with pytest.raises(ConfigError, match="engine = 'cuda' must be one of numba"):
        hopper.run(engine="cuda")  # type: ignore[arg-type]
    with pytest.raises(SimulationError, match="floor_angle"):
        hopper.run({"floor_angle": 95.0})


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"design": {"opening": "x"}}, "opening = 'x' must be a number"),
        ({"design": {"opening": float("nan")}}, "opening = nan must be a finite number"),
        ({"design": {"opening": 1e30}}, "opening = 1e[+]30 must be at most 10000"),
        ({"design": {5: 1.0}}, "no variable 5"),
        ({"design": [30.0]}, "must give values by name"),
        ({"seed": -1}, "seed = -1 must be at least 0"),
        ({"seed": None}, "seed = None must be a whole number"),
    ],
)
def test_a_wrong_design_or_seed_is_refused(given: dict[str, Any], match: str) -> None:
    with pytest.raises(ConfigError, match=match):
        mfopt.load_scene("discharge").run(**given)


@pytest.mark.parametrize(
    ("scene", "design", "match"),
    [
        ("heap", {"lift_speed": 1e-9}, "lift_speed = 1e-09 mm/s would take"),
        ("heap", {"radius": -1.0}, "radius = -1 mm must be positive"),
        ("silo", {"width": 0.0}, "width = 0 mm must be positive"),
        ("silo", {"width": -5.0}, "width = -5 mm must be positive"),
        ("discharge", {"opening": 130.0}, "opening = 130 mm must .* box's 120 mm"),
        ("discharge", {"floor_angle": -1.0}, "floor_angle = -1 deg"),
    ],
)
def test_a_design_that_cannot_be_built_is_impossible(
    scene: str, design: dict[str, float], match: str
) -> None:
    its = mfopt.load_scene(scene, free={name: (-9.0, 200.0) for name in design})
    x = np.array(list(design.values()))
    assert re.search(match, its.scene.problem().impossible(x) or "")


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"name": "x"}, "unknown key 'name'"),
        ({"engine": "numba", "precision": "longdouble"}, "an option of the engine 'yade'"),
        ({"effects": {"vibration": {"amplitude": -1.0}}}, "must be at least 0"),
        ({"effects": []}, r"effects = \[\] must be a table"),
    ],
)
def test_what_a_run_would_ignore_is_refused(given: dict[str, Any], match: str) -> None:
    with pytest.raises(ConfigError, match=match):
        mfopt.load_scene("heap").run(**given)


def test_a_scene_that_is_no_name_is_refused() -> None:
    with pytest.raises(ConfigError, match="no scene 5"):
        mfopt.load_scene(5)  # type: ignore[arg-type]


def test_every_run_of_a_search_is_a_row_of_a_frame() -> None:
    best = mfopt.minimize({"f": lambda x, seed: float(x[0] ** 2)}, {"a": (-1, 1)}, budget=8)
    frame = best.frame()
    assert len(frame) == len(best.evaluations)
    assert list(frame.columns) == ["a", "level", "seed", "f", "status"]
    assert frame["f"].min() == best.best_run.objective


def test_a_notebook_completes_the_public_names() -> None:
    assert set(mfopt.__all__) <= set(dir(mfopt))
