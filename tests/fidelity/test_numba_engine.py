"""The face of the compiled engine: loaded late, compiled once."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numba
import pytest
from engine_scenes import GRAIN_MATERIAL, WALL_MATERIAL, line_of, pile_in_box
from numba.core.event import install_listener

from fidelity.engine import Physics
from fidelity.engines.numba import NumbaEngine, first_only, prepare
from fidelity.engines.yade.engine import YadeEngine
from fidelity.grains.settings import DemSettings
from fidelity.level import SceneLevel
from fidelity.scenes.dosing.design import dosing_problem
from fidelity.scenes.dosing.scene import Dosing
from fidelity.scenes.dosing.settings import DosingSettings


def kernel() -> dict[str, list[object]]:
    """What each function of the kernel has been compiled for so far."""
    return {
        f"{module.__name__}.{name}": list(function.signatures)
        for module in list(sys.modules.values())
        if getattr(module, "__name__", "").startswith("fidelity.dem")
        for name, function in vars(module).items()
        if hasattr(function, "signatures")
    }


def test_after_preparing_a_dosing_run_compiles_nothing(tmp_path: Path) -> None:
    prepare()
    before = kernel()
    settings, dem = DosingSettings(), DemSettings(grains=60)
    level = SceneLevel("l", Dosing(settings), dem, NumbaEngine(), cache=tmp_path, snapshots=2)
    outcome = level.evaluate(dosing_problem(settings).baseline, seed=1)
    assert outcome.status == "finished", outcome.why
    assert outcome.raw["settling_work"] > 0  # so it has settled grains, too
    assert any(before.values())
    assert kernel() == before


def test_nothing_is_said_where_nothing_is_compiled() -> None:
    prepare()
    said: list[str] = []
    prepare(lambda: said.append("compiling"))
    assert said == []


def test_compiling_is_said_once() -> None:
    said: list[str] = []
    with install_listener("numba:compile", first_only(lambda: said.append("compiling"))):
        for shift in (1, 2):
            numba.njit(lambda x, shift=shift: x + shift)(0.5)
    assert said == ["compiling"]


@pytest.mark.parametrize("module", ["mfopt.commands.app", "fidelity.level", "mfopt.study.assemble"])
def test_numba_is_not_loaded_before_it_is_used(module: str) -> None:
    look = f"import sys, {module}; print('numba' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", look], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False"]


def test_the_time_limit_ends_a_run_however_short_its_step() -> None:
    setup = pile_in_box(duration=1.0)
    movement = NumbaEngine(fixed_timestep=1e-14).move(setup, time_limit_s=0.1)
    assert movement.status == "timed_out"
    assert 0 < movement.sphere_steps < 2e7  # of 2e13 to the first look


def test_the_usual_step_is_the_engines_own() -> None:
    grain, soft, wall = line_of(3), GRAIN_MATERIAL, WALL_MATERIAL
    linear = Physics(timestep_factor=None)
    hertz = replace(linear, contact_law="hertz", restitution=0.6)
    for physics, usual in ((hertz, 2.0), (linear, 0.6)):
        given = replace(physics, timestep_factor=usual)
        steps = [NumbaEngine().timestep(grain, soft, wall, its) for its in (physics, given)]
        assert steps[0] == steps[1]
    damped = replace(hertz, restitution=0.3)
    usual, given = (
        NumbaEngine().timestep(grain, soft, wall, replace(damped, timestep_factor=factor))
        for factor in (None, 1.6)  # at 1.6 a discharge is still right, at 2.0 it is not
    )
    assert 0.8 * given < usual <= given
    steps = [YadeEngine().timestep(grain, soft, wall, its) for its in (hertz, linear)]
    assert steps[0] == steps[1]  # with a low restitution YADE is wrong at longer ones
