"""From a study's tables to levels: the engine that confirms."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mfopt.study.assemble as assembly
from fidelity.engines.numba import NumbaEngine
from fidelity.engines.yade.engine import YadeEngine
from fidelity.level import SceneLevel
from mfopt.errors import ConfigError
from mfopt.settings import checked
from mfopt.study.assemble import Assembled, assemble
from mfopt.study.file import Study

TOP = {"name": "dem-40", "engine": "numba", "grains": 40, "young_modulus_pa": 2e6}


def assembled(
    reference: str | list[str] | None, top: dict[str, Any] | None = None, **other: Any
) -> Assembled:
    """A dosing study with this reference and top level; `other` replaces whole tables."""
    levels = [{"name": "reduced", "engine": "reduced"}, TOP if top is None else top]
    study: dict[str, Any] = {
        "study": {"name": "s"},
        "problem": {"scene": "dosing", "objective": "dispersion"},
        "level": levels,
        "search": {"method": "cma-es", "stage": [{"level": levels[-1]["name"], "generations": 1}]},
        "confirm": {"seeds": 2, **({} if reference is None else {"reference": reference})},
    }
    return assemble(checked(Study, study | other, where="study"), where="study")


@pytest.fixture
def no_yade(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine where YADE is not installed."""

    class Missing(YadeEngine):
        def version(self) -> str:
            raise ConfigError("yade is not installed; install it")

    monkeypatch.setattr(assembly, "YadeEngine", Missing)


@pytest.fixture
def any_yade(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine where YADE answers."""

    class There(YadeEngine):
        def version(self) -> str:
            return "2023.02a"

    monkeypatch.setattr(assembly, "YadeEngine", There)


def test_a_study_without_a_reference_has_none() -> None:
    parts = assembled(None)
    assert (parts.reference, parts.reference_level) == (None, None)
    assert parts.all_levels.names == parts.ladder.names


@pytest.mark.usefixtures("any_yade")
def test_the_reference_is_the_top_level_but_for_its_engine() -> None:
    parts = assembled("yade")
    top, reference = parts.ladder.top, parts.reference_level
    assert isinstance(top, SceneLevel)
    assert isinstance(reference, SceneLevel)
    assert reference.dem == top.dem
    assert reference.scene == top.scene
    assert reference.dem.young_modulus_pa == 2e6
    assert isinstance(reference.engine, YadeEngine)
    assert reference.snapshots == 0
    assert parts.reference is not None
    assert (parts.reference.level, parts.reference.engine) == ("dem-40-yade", "yade")
    assert reference.name == "dem-40-yade"
    assert parts.all_levels.names == ("reduced", "dem-40", "dem-40-yade")


@pytest.mark.usefixtures("any_yade")
def test_the_reference_is_no_level_of_the_ladder() -> None:
    parts = assembled("yade")
    assert parts.ladder.names == parts.confirm_on.names == ("reduced", "dem-40")
    assert len(parts.described) == 2
    assert "yade" not in parts.versions


@pytest.mark.usefixtures("any_yade")
def test_the_precision_of_the_top_level_is_kept() -> None:
    reference = assembled("yade", {**TOP, "precision": "longdouble"}).reference_level
    assert isinstance(reference, SceneLevel)
    assert reference.engine.name == "yade-longdouble"


@pytest.mark.usefixtures("no_yade")
def test_without_the_engine_the_run_goes_on_and_says_why() -> None:
    parts = assembled("yade")
    assert parts.reference_level is None
    assert parts.reference is not None
    assert parts.reference.why_not is not None
    assert "yade is not installed; install it" in parts.reference.why_not
    assert parts.reference.level == ""


@pytest.mark.usefixtures("no_yade")
def test_the_first_installed_engine_of_several_is_taken() -> None:
    reference = assembled(["yade", "bullet"]).reference_level
    assert reference is not None
    assert reference.name == "dem-40-bullet"


@pytest.mark.usefixtures("any_yade")
def test_an_engine_does_not_confirm_itself() -> None:
    parts = assembled("yade", {**TOP, "engine": "yade"})
    assert parts.reference_level is None
    assert parts.reference is not None
    assert parts.reference.why_not == "the target level runs on yade itself"
    other = assembled(["yade", "numba"], {**TOP, "engine": "yade"}).reference_level
    assert isinstance(other, SceneLevel)
    assert isinstance(other.engine, NumbaEngine)


@pytest.mark.usefixtures("any_yade")
def test_wrong_references_are_refused_with_the_remedy() -> None:
    with pytest.raises(ConfigError, match=r"confirm.reference = 'yaed' must be one of 'numba'"):
        assembled("yaed")
    with pytest.raises(ConfigError, match=r"'flow' has no grains.*leave the reference out"):
        assembled("yade", {"name": "flow", "engine": "reduced", "grains": 100})
    taken = {**TOP, "name": "dem-40-yade", "grains": 20}
    with pytest.raises(ConfigError, match=r"called 'dem-40-yade'; rename"):
        assembled("yade", level=[taken, TOP])
    with pytest.raises(ConfigError, match=r"confirm: reference needs a run .* seeds to at least 1"):
        assembled(None, confirm={"seeds": 0, "reference": "yade"})


def test_a_problem_of_the_users_own_has_no_reference(tmp_path: Path) -> None:
    program = tmp_path / "program"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    with pytest.raises(ConfigError, match=r"give a scene.* or leave the reference out"):
        assembled(
            "yade",
            {"name": "mine", "engine": "command", "command": [str(program)]},
            level=[{"name": "mine", "engine": "command", "command": [str(program)]}],
            problem={
                "objective": "returned",
                "variable": [{"name": "a", "lower": 0.0, "upper": 1.0}],
            },
        )


@pytest.mark.usefixtures("any_yade")
def test_work_of_the_reference_counts_its_engine() -> None:
    parts = assembled("yade")
    reference = parts.reference_level
    assert reference is not None
    baseline = np.asarray(parts.problem.baseline)
    assert reference.work(baseline) > 5 * parts.ladder.top.work(baseline)


LADDER = [{"name": "dem-50", "engine": "numba", "grains": 50}, {**TOP, "grains": 120}]


@pytest.mark.parametrize(("budget", "seeds"), [(3.0, 1), (60.0, 3)])
def test_simple_motions_cost_a_quarter_of_the_budget_or_have_one_seed(
    budget: float, seeds: int
) -> None:
    its = assembled(None, level=LADDER, search={"budget": budget, "seeds": 20})
    assert its.starts is not None
    assert (its.starts.level, its.starts.seeds) == ("dem-50", seeds)
    assert len(its.starts.designs) == 7


def test_a_level_dearer_than_the_target_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"study: .*from cheap to dear"):
        assembled(None, level=LADDER[::-1], search={"budget": 30.0})


def test_a_limit_in_seconds_is_refused() -> None:
    problem = {"scene": "dosing", "objective": "dispersion", "filling_time_limit_ms": 0.33}
    with pytest.raises(ConfigError, match=r"filling_time_limit_ms = 0\.33"):
        assembled(None, problem=problem)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"effects": {"grain_aspect": {"aspect": 0.5}}}, "study: level 2: the scene dosing lacks"),
        ({"effects": {"tilt": {"angle": 9.0}}}, "study: level 2: effect 'tilt': angle = 9 rad"),
        ({"precision": "double"}, "study: level 2: precision = 'double' is an option of .* 'yade'"),
    ],
)
def test_what_a_level_cannot_have_is_refused_with_its_place(
    more: dict[str, Any], message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        assembled(None, {**TOP, **more})
