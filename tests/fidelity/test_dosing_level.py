import pickle
from pathlib import Path

import numpy as np
import pytest
from engine_scenes import ENGINES

from fidelity.engine import Engine
from fidelity.engines.bullet.engine import BulletEngine
from fidelity.engines.yade.engine import YadeEngine
from fidelity.grains.settings import DemSettings
from fidelity.level import SceneLevel
from fidelity.scenes.dosing.bound import filling_time_bound
from fidelity.scenes.dosing.design import design, dosing_problem
from fidelity.scenes.dosing.objectives import dispersion
from fidelity.scenes.dosing.scene import Dosing
from fidelity.scenes.dosing.settings import DosingSettings
from mfopt.arrays import Array
from mfopt.campaign.check import Probed
from mfopt.records.outcome import Outcome

SETTINGS = DosingSettings()
PROBLEM = dosing_problem(SETTINGS)
DEM = DemSettings(grains=100, spheres_per_grain=1, time_limit_s=300)


def with_values(**values: float) -> Array:
    return np.array([{**PROBLEM.named(PROBLEM.baseline), **values}[n] for n in PROBLEM.names])


# A cup that slows down over the hole.
SLOW = with_values(x1=0.3, y1=0.45, x2=0.7, y2=0.6, v=1.2)


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("packings")


def accounted(outcome: Outcome) -> bool:
    raw = outcome.raw
    counts = sum(int(raw[name]) for name in ("passed", "left_in_cup", "left_in_hopper", "lost"))
    return counts == int(raw["grains"]) and raw["passage_times"].size == int(raw["passed"])


@pytest.mark.parametrize("engine", ENGINES)
def test_slow_cup_empties_into_the_bag(engine: Engine, cache: Path) -> None:
    level = SceneLevel("coarse", Dosing(SETTINGS), DEM, engine, cache, snapshots=2)
    outcome = level.evaluate(SLOW, seed=0)
    raw = outcome.raw
    assert outcome.finished, outcome.why
    assert accounted(outcome)
    assert int(raw["lost"]) == 0
    assert int(raw["passed"]) >= 0.8 * DEM.grains
    times = raw["passage_times"]
    assert np.all(np.diff(times) >= 0)
    # No grain passes sooner than in free fall after the hole opened.
    assert times[0] > np.sqrt(2 * 0.56 / 9.81)
    assert np.ptp(times) > filling_time_bound(design(SETTINGS, SLOW))
    assert sum(dispersion(raw).values()) > 0
    assert raw["snapshot_positions"].shape == (2, DEM.grains, 3)
    assert raw["snapshot_positions"].dtype == np.float32
    assert 0.3 * level.work(SLOW) < outcome.work < 3 * level.work(SLOW)


@pytest.mark.parametrize("engine", ENGINES)
def test_every_grain_is_accounted_for_at_random_designs(engine: Engine, cache: Path) -> None:
    rng, level = (
        np.random.default_rng(5),
        SceneLevel("coarse", Dosing(SETTINGS), DEM, engine, cache),
    )
    tried = 0
    while tried < 2:
        x = PROBLEM.to_x(rng.random(PROBLEM.dimension))
        if PROBLEM.impossible(x) is not None:
            continue
        tried += 1
        outcome = level.evaluate(x, seed=0)
        if outcome.raw:
            assert accounted(outcome)
            assert outcome.finished == (int(outcome.raw["lost"]) == 0)
        else:
            assert outcome.status == "crashed"
            assert outcome.why


@pytest.mark.parametrize("engine", ENGINES)
def test_same_seed_gives_the_same_outcome_bit_for_bit(engine: Engine, tmp_path: Path) -> None:
    dem = DEM.model_copy(update={"grains": 40, "spheres_per_grain": 1})
    level = SceneLevel("coarsest", Dosing(SETTINGS), dem, engine, tmp_path)
    first, again = (level.evaluate(SLOW, seed=3) for _ in range(2))
    assert np.array_equal(first.raw["passage_times"], again.raw["passage_times"])
    assert float(first.raw["settling_work"]) > 0
    assert float(again.raw["settling_work"]) == 0


@pytest.mark.parametrize("engine", ENGINES)
def test_the_first_steps_cost_their_share(engine: Engine, cache: Path) -> None:
    level = SceneLevel("coarse", Dosing(SETTINGS), DEM, engine, cache, snapshots=2)
    outcome = level.probe(SLOW, seed=0, share=0.1)
    assert outcome.finished, outcome.why
    assert isinstance(level, Probed)
    assert 0.07 * level.work(SLOW) < outcome.work < 0.13 * level.work(SLOW)
    assert outcome.cpu_s > 0.0


def test_first_steps_that_cannot_be_run_are_a_failed_run(tmp_path: Path) -> None:
    level = SceneLevel("coarse", Dosing(SETTINGS), DEM, BulletEngine(), tmp_path)
    assert level.probe(with_values(r1=45.0, w1=60.0), seed=0, share=0.1).status == "invalid_design"
    one_grain = DEM.model_copy(update={"grains": 1, "spheres_per_grain": 5})
    one = SceneLevel("one", Dosing(SETTINGS), one_grain, BulletEngine(), tmp_path)
    assert one.probe(SLOW, seed=0, share=0.1).status == "crashed"


def test_impossible_design_is_not_simulated(tmp_path: Path) -> None:
    level = SceneLevel("coarse", Dosing(SETTINGS), DEM, BulletEngine(), tmp_path / "cache")
    outcome = level.evaluate(with_values(w1=60.0, r1=45.0), seed=0)
    assert outcome.status == "invalid_design"
    assert "radius" in (outcome.why or "")
    assert outcome.work == 0
    assert not (tmp_path / "cache").exists()


def test_portion_that_does_not_fit_is_a_failed_run(tmp_path: Path) -> None:
    dem = DEM.model_copy(update={"grains": 1, "spheres_per_grain": 5})
    level = SceneLevel("one", Dosing(SETTINGS), dem, BulletEngine(), tmp_path)
    outcome = level.evaluate(SLOW, seed=0)
    assert outcome.status == "crashed"
    assert "use more grains" in (outcome.why or "")


def test_work_grows_with_grains_and_with_stiffness() -> None:
    def work(**changes: object) -> float:
        dem = DEM.model_copy(update=changes)
        return SceneLevel("any", Dosing(SETTINGS), dem, YadeEngine()).work(SLOW)

    # Steps go with 1 / radius: 8 times the grains are 16 times the work.
    assert work(grains=800) / work(grains=100) == pytest.approx(16, rel=1e-9)
    assert work(young_modulus_pa=4e6) / work(young_modulus_pa=1e6) == pytest.approx(2, rel=1e-9)


def test_level_can_be_sent_to_another_process() -> None:
    level = SceneLevel("coarse", Dosing(SETTINGS), DEM, BulletEngine())
    assert pickle.loads(pickle.dumps(level)) == level
