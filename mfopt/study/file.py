"""Study files (TOML): read, checked once, and refused with the key, the limit and the remedy."""

from pathlib import Path
from typing import Any, Literal

from pydantic import ConfigDict, Field, model_validator

from mfopt.campaign.phases import Finals
from mfopt.errors import ConfigError
from mfopt.files.toml_text import toml_tables, toml_text
from mfopt.limits import (
    MOST_LEVELS,
    MOST_STAGES,
    MOST_VARIABLES,
    Bound,
    Budget,
    ConfirmSeeds,
    FileName,
    Generations,
    Name,
    PopulationSize,
    SearchSeeds,
    Seed,
    Sigma,
    Word,
    Workers,
)
from mfopt.search.search import Reevaluate, Stage
from mfopt.settings import Settings, checked, nearest

POPULATION_SIZE = 16  # of a stage that names none


class CaseGiven(ConfigError):
    """The file is a case of a calibration, not a study."""


class StudyHead(Settings):
    """What the study is called and which seed all its random draws follow from."""

    name: FileName
    seed: Seed = 1


class StageSettings(Settings):
    """One stage of the plan; what is left out is taken from `[search]`."""

    level: str
    generations: Generations
    population_size: PopulationSize | None = None
    sigma: Sigma | None = None
    seeds: SearchSeeds | None = None
    objective: str | None = None


class SearchSettings(Settings):
    """The search: surrogate-assisted over all levels, or CMA-ES on a planned list of them."""

    method: Literal["assisted", "cma-es"] = "assisted"
    budget: Budget | None = None  # of the assisted search [full runs]
    population_size: PopulationSize | None = None
    sigma: Sigma = 0.2
    seeds: SearchSeeds = 1
    reevaluate: Reevaluate = "none"
    exchange: tuple[str, str] | None = Field(default=None, strict=False)
    stage: list[StageSettings] = Field(default_factory=list, max_length=MOST_STAGES)

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

    Before that the best design is told from its rivals: so many `finalists` of the search, and the
    best of the designs that it may have started from, on others (`campaign.phases.Finals`): on
    `finalist_seeds` each, the better half on twice as many more, until one is left.

    `reference` names the engine, or several in order of preference, on which both are run once
    more with the first of these seeds.
    """

    finalists: int = Field(default=1, ge=1, le=100)
    finalist_seeds: int = Field(default=3, ge=1, le=1000)
    seeds: ConfirmSeeds = 5
    reference: str | list[str] | None = None

    @property
    def finals(self) -> Finals:
        """How the best design is told from its rivals."""
        return Finals(self.finalists, self.finalist_seeds)

    def runs(self, *, starts: bool) -> int:
        """Runs at the target level after the search, by whether the study has starts."""
        rivals = self.finalists + 2 * starts  # the best start, and the baseline
        return 2 * self.seeds + self.finals.runs(rivals)

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

    workers: Workers | None = None  # None: one per core
    scheduler: str | None = None  # address of a Dask scheduler, e.g. tcp://10.0.0.1:8786


class VariableSettings(Settings):
    """A variable of a problem of the user's own; the search starts at `start`."""

    name: Name
    lower: Bound
    upper: Bound
    start: Bound | None = None  # None: the middle
    unit: Name = "-"


class ProblemSettings(Settings):
    """The scene, or the variables of a problem of the user's own.

    The scene checks its own table, which has its name, and all other keys: what the study wants of
    its objectives.
    """

    model_config = ConfigDict(extra="allow")

    scene: str | None = None
    objective: str
    objective_unit: Name = "-"
    variable: list[VariableSettings] = Field(default_factory=list, max_length=MOST_VARIABLES)

    @property
    def others(self) -> dict[str, Any]:
        """The keys that are the scene's."""
        return dict(self.model_extra or {})


class Study(Settings):
    """A whole study file. `level` tables are checked by the engine that they name."""

    # Path of a material file, relative to the study file (`mfopt.study.material`).
    material: Word | None = None
    study: StudyHead
    problem: ProblemSettings
    level: list[dict[str, Any]] = Field(max_length=MOST_LEVELS)
    search: SearchSettings
    confirm: ConfirmSettings = ConfirmSettings()
    run: RunSettings = RunSettings()


def read_study(path: Path) -> tuple[Study, str]:
    """Read a study file; return it with its text as given.

    Raises:
        ConfigError: if it cannot be read, is not TOML, or has a wrong, unknown or missing key.
    """
    text = toml_text(path, "study file", "`mfopt init` writes one")
    return study_of(text, where=str(path)), text


def study_of(text: str, *, where: str) -> Study:
    """The study that a text describes.

    Args:
        text: TOML.
        where: its file, for messages.

    Raises:
        CaseGiven: if it is a case of a calibration.
        ConfigError: if it is not TOML, or has a wrong, unknown or missing key.
    """
    data = toml_tables(text, where)
    if "study" not in data and not data.keys().isdisjoint(("case", "recording")):
        raise CaseGiven(
            f"{where} is a case of a calibration, not a study; give it to mfopt calibrate"
        )
    study = checked(Study, data, where=where)
    _check_levels(study, where)
    return study


def _check_levels(study: Study, where: str) -> None:
    names = [str(level.get("name")) for level in study.level]
    if not names:
        raise ConfigError(f"{where}: the ladder is empty; give at least one [[level]]")
    for stage in study.search.stage:
        if stage.level not in names:
            raise ConfigError(
                f"{where}: search.stage names level {stage.level!r}, which the ladder lacks"
                f"{nearest(stage.level, names)}"
            )
