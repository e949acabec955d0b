"""Study files (TOML): read, checked once, and refused with the key, the limit and the remedy."""

import tomllib
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, model_validator

from mfopt.errors import ConfigError
from mfopt.objective import objective_named
from mfopt.search import Reevaluate, Stage
from mfopt.settings import Settings, checked, nearest

POPULATION_SIZE = 16  # of a stage that names none


class StudyHead(Settings):
    """What the study is called and which seed all its random draws follow from."""

    name: str = Field(min_length=1)
    seed: int = Field(default=1, ge=0)


class StageSettings(Settings):
    """One stage of the plan; what is left out is taken from `[search]`."""

    level: str
    generations: int = Field(ge=1)
    population_size: int | None = Field(default=None, ge=3)
    sigma: float | None = Field(default=None, gt=0.0, le=1.0)
    seeds: int | None = Field(default=None, ge=1)
    objective: str | None = None


class SearchSettings(Settings):
    """The search: surrogate-assisted over all levels, or CMA-ES on a planned list of them."""

    method: Literal["assisted", "cma-es"] = "assisted"
    budget: float | None = Field(default=None, ge=1.0)  # of the assisted search [full runs]
    population_size: int | None = Field(default=None, ge=3)
    sigma: float = Field(default=0.2, gt=0.0, le=1.0)
    seeds: int = Field(default=1, ge=1)
    reevaluate: Reevaluate = "none"
    exchange: tuple[str, str] | None = Field(default=None, strict=False)
    stage: list[StageSettings] = Field(default_factory=list)

    @model_validator(mode="after")
    def _complete(self) -> "SearchSettings":
        if self.method == "assisted":
            if self.stage:
                raise ValueError(
                    'stages are of method = "cma-es"; the assisted search changes the level by '
                    "itself: give it a budget instead"
                )
            if self.reevaluate != "none":
                raise ValueError(
                    'reevaluate is of method = "cma-es"; the assisted search decides by itself '
                    "what is run again"
                )
            if self.budget is None:
                raise ValueError("budget is missing; give it in runs of the target level")
        elif not self.stage:
            raise ValueError("there is no [[search.stage]]; plan at least one level")
        elif self.budget is not None:
            raise ValueError('budget is of method = "assisted"; the stages say what is spent')
        return self

    def stages(self, objective: str) -> tuple[Stage, ...]:
        """The plan, with what a stage leaves out filled in."""
        return tuple(
            Stage(
                level=s.level,
                generations=s.generations,
                population_size=s.population_size or self.population_size or POPULATION_SIZE,
                sigma=s.sigma or self.sigma,
                objective=s.objective or objective,
                seeds=s.seeds or self.seeds,
                reevaluate=self.reevaluate,
            )
            for s in self.stage
        )


class ConfirmSettings(Settings):
    """Fresh seeds on which the best and the baseline design are run at the top level.

    `reference` names the engine, or several in order of preference, on which both are run once
    more with the first of these seeds.
    """

    seeds: int = Field(default=5, ge=0)
    reference: str | list[str] | None = None

    @property
    def references(self) -> tuple[str, ...]:
        """Names of the engines that may be the reference, the preferred one first."""
        given = self.reference or []
        return (given,) if isinstance(given, str) else tuple(given)

    @model_validator(mode="after")
    def _comparable(self) -> "ConfirmSettings":
        if self.references and not self.seeds:
            raise ValueError("reference needs a run to be compared with; set seeds to at least 1")
        return self


class RunSettings(Settings):
    """Where the runs are made."""

    workers: int | None = Field(default=None, ge=1)  # None: one per core
    scheduler: str | None = None  # address of a Dask scheduler, e.g. tcp://10.0.0.1:8786


class VariableSettings(Settings):
    """A variable of a problem of the user's own; the search starts at `start`."""

    name: str = Field(min_length=1)
    lower: float
    upper: float
    start: float | None = None  # None: the middle
    unit: str = "-"


class ProblemSettings(Settings):
    """The scene, or the variables of a problem of the user's own."""

    scene: Literal["dosing"] | None = None
    objective: str
    objective_unit: str = "-"
    dosing: dict[str, Any] = Field(default_factory=dict)
    variable: list[VariableSettings] = Field(default_factory=list)


class Study(Settings):
    """A whole study file. `level` tables are checked by the engine that they name."""

    study: StudyHead
    problem: ProblemSettings
    level: list[dict[str, Any]]
    search: SearchSettings
    confirm: ConfirmSettings = ConfirmSettings()
    run: RunSettings = RunSettings()


def read_study(path: Path) -> tuple[Study, str]:
    """Read a study file; return it with its text as given.

    Raises:
        ConfigError: if it cannot be read, is not TOML, or has a wrong, unknown or missing key.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError as error:
        raise ConfigError(f"study file {path} does not exist; `mfopt init` writes one") from error
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"cannot read study file {path}: {error}") from error
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path} is not valid TOML: {error}") from error
    study = checked(Study, data, where=str(path))
    _check_levels(study, path)
    return study, text


def _check_levels(study: Study, path: Path) -> None:
    names = [str(level.get("name")) for level in study.level]
    if not names:
        raise ConfigError(f"{path}: the ladder is empty; give at least one [[level]]")
    for stage in study.search.stage:
        if stage.level not in names:
            raise ConfigError(
                f"{path}: search.stage names level {stage.level!r}, which the ladder lacks"
                f"{nearest(stage.level, names)}"
            )
        if stage.objective is not None:
            objective_named(stage.objective)
    objective_named(study.problem.objective)
