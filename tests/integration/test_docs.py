"""The page on the study file names every key, objective, quantity and effect."""

from pathlib import Path

import pytest
from pydantic import BaseModel

from fidelity.effects.kinds import PortionEffect, SetupEffect
from fidelity.effects.switch import EFFECTS
from fidelity.grains.settings import MaterialSettings
from fidelity.scene import Scene
from fidelity.scenes.dosing.settings import CupSettings
from mfopt.study import file as study
from mfopt.study.assemble import (
    SCENES,
    CommandLevelSettings,
    DemLevelSettings,
    ReducedLevelSettings,
)

PAGE = (Path(__file__).parent.parent.parent / "docs" / "study-file.md").read_text()
MODELS = [
    study.StudyHead, study.ProblemSettings, study.VariableSettings, study.SearchSettings,
    study.StageSettings, study.ConfirmSettings, study.RunSettings, CupSettings,
    MaterialSettings, DemLevelSettings, ReducedLevelSettings, CommandLevelSettings,
    *(type(kind().settings) for kind in SCENES.values()),
    *(type(kind().wanted) for kind in SCENES.values()),
]  # fmt: skip


@pytest.mark.parametrize("model", MODELS)
def test_every_key_is_explained(model: type[BaseModel]) -> None:
    missing = [
        key for key in model.model_fields if f"`{key}`" not in PAGE and f".{key}]" not in PAGE
    ]
    assert missing == []


@pytest.mark.parametrize("kind", SCENES.values())
def test_every_objective_is_explained(kind: type[Scene]) -> None:
    assert [name for name in kind().criteria().objectives if f'`"{name}"`' not in PAGE] == []


@pytest.mark.parametrize("kind", SCENES.values())
def test_every_quantity_is_explained(kind: type[Scene]) -> None:
    its = kind().criteria()
    shown = [each.name for each in (*its.quantities, *its.series)]
    assert [name for name in shown if f"`{name}`" not in PAGE] == []


@pytest.mark.parametrize("its", EFFECTS.values(), ids=list(EFFECTS))
def test_every_effect_has_its_line(its: PortionEffect | SetupEffect) -> None:
    parameters = ", ".join(
        f"`{name}` [{p.unit}]: {p.meaning} ({p.null:g})"
        for name, p in its.effect.parameters.items()
    )
    line = f"| `{its.effect.name}` | {parameters} | {', '.join(its.engines)} |"
    assert line in PAGE.splitlines()
