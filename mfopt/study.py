"""Study files (TOML): read, checked once, and refused with the key, the limit and the remedy."""

import difflib
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from mfopt.errors import ConfigError
from mfopt.objective import objective_named
from mfopt.search import Stage

S = TypeVar("S", bound=BaseModel)


class Settings(BaseModel):
    """Base of all settings: read-only, unknown keys and nan refused, no silent conversion."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", allow_inf_nan=False, strict=True, arbitrary_types_allowed=True
    )


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
    """The search and its planned list of levels."""

    method: str = "cma-es"
    population_size: int = Field(default=16, ge=3)
    sigma: float = Field(default=0.2, gt=0.0, le=1.0)
    seeds: int = Field(default=1, ge=1)
    exchange: tuple[str, str] | None = Field(default=None, strict=False)
    stage: list[StageSettings]

    def stages(self, objective: str) -> tuple[Stage, ...]:
        """The plan, with what a stage leaves out filled in."""
        return tuple(
            Stage(
                level=s.level,
                generations=s.generations,
                population_size=s.population_size or self.population_size,
                sigma=s.sigma or self.sigma,
                objective=s.objective or objective,
                seeds=s.seeds or self.seeds,
            )
            for s in self.stage
        )


class ConfirmSettings(Settings):
    """Fresh seeds on which the best and the baseline design are run at the top level."""

    seeds: int = Field(default=5, ge=0)


class RunSettings(Settings):
    """Where the runs are made."""

    workers: int | None = Field(default=None, ge=1)  # None: one per core
    scheduler: str | None = None  # address of a Dask scheduler, e.g. tcp://10.0.0.1:8786


class ProblemSettings(Settings):
    """The scene, or the variables of a problem of the user's own."""

    scene: str | None = None
    objective: str
    objective_unit: str = "-"
    dosing: dict[str, Any] = Field(default_factory=dict)
    variable: list[dict[str, Any]] = Field(default_factory=list)


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
    if not study.search.stage:
        raise ConfigError(f"{path}: the search has no [[search.stage]]; plan at least one level")
    for stage in study.search.stage:
        if stage.level not in names:
            raise ConfigError(
                f"{path}: search.stage names level {stage.level!r}, which the ladder lacks"
                f"{_nearest(stage.level, names)}"
            )
        if stage.objective is not None:
            objective_named(stage.objective)
    objective_named(study.problem.objective)


def checked(model: type[S], data: Mapping[str, Any], *, where: str) -> S:
    """Check `data` against a settings model.

    Raises:
        ConfigError: names the key with its place, what is wrong with it and the nearest key.
    """
    try:
        return model.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        raise ConfigError(f"{where}: {_explained(model, first)}") from error


def _explained(model: type[BaseModel], error: Mapping[str, Any]) -> str:
    place = error["loc"]
    key = ".".join(str(part + 1) if isinstance(part, int) else part for part in place)
    match error["type"]:
        case "extra_forbidden":
            known = sorted(_fields_at(model, place[:-1]))
            return f"unknown key {key!r}{_nearest(str(place[-1]), known)}"
        case "missing":
            return f"key {key!r} is missing; add it"
        case "finite_number":
            return f"{key} = {error['input']} must be a finite number"
        case _:
            return f"{key} = {error['input']!r}: {error['msg'].lower()}"


def _fields_at(model: Any, place: tuple[str | int, ...]) -> list[str]:
    """Field names of the settings model found at `place` below `model`."""
    for part in place:
        if isinstance(part, int):
            continue
        kind = model.model_fields[part].annotation
        inner = [a for a in (kind, *getattr(kind, "__args__", ())) if hasattr(a, "model_fields")]
        if not inner:
            return []
        model = inner[0]
    return list(model.model_fields)


def _nearest(key: str, known: list[str]) -> str:
    close = difflib.get_close_matches(key, known, n=1, cutoff=0.5)
    if close:
        return f"; did you mean {close[0]!r}?"
    return f"; known are {', '.join(known)}" if known else ""
