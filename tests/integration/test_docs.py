"""The page on the study file names every key."""

from pathlib import Path

import pytest
from pydantic import BaseModel

from fidelity.grains.settings import MaterialSettings
from fidelity.scenes.dosing.settings import CupSettings, DosingSettings
from mfopt.study import file as study
from mfopt.study.assemble import CommandLevelSettings, DemLevelSettings, ReducedLevelSettings

PAGE = (Path(__file__).parent.parent.parent / "docs" / "study-file.md").read_text()
MODELS = [
    study.StudyHead, study.ProblemSettings, study.VariableSettings, study.SearchSettings,
    study.StageSettings, study.ConfirmSettings, study.RunSettings, DosingSettings, CupSettings,
    MaterialSettings, DemLevelSettings, ReducedLevelSettings, CommandLevelSettings,
]  # fmt: skip


@pytest.mark.parametrize("model", MODELS)
def test_every_key_is_explained(model: type[BaseModel]) -> None:
    missing = [
        key for key in model.model_fields if f"`{key}`" not in PAGE and f".{key}]" not in PAGE
    ]
    assert missing == []
