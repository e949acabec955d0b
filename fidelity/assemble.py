"""From a study's tables to a problem and a ladder: the one place that knows every engine."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from fidelity.bullet import BulletEngine
from fidelity.command import CommandLevel
from fidelity.dosing import dosing_problem
from fidelity.dosing_level import DosingLevel
from fidelity.engine import Engine
from fidelity.reduced import ReducedDosing
from fidelity.settings import DemSettings, DosingSettings
from fidelity.yade import YadeEngine
from mfopt.arrays import frozen
from mfopt.errors import ConfigError
from mfopt.level import Ladder, Level
from mfopt.problem import Problem, Variable
from mfopt.settings import Settings, checked
from mfopt.study import ProblemSettings, Study

SNAPSHOTS = 4  # moments of the best run that the report shows

Precision = Literal["double", "longdouble", "float128"]
DemName = Literal["yade", "bullet"]


class DemLevelSettings(DemSettings):
    """A level on a discrete-element engine; of several engines the first installed one runs."""

    name: str = Field(min_length=1)
    engine: DemName | list[DemName]
    precision: Precision = "double"  # of YADE


class ReducedLevelSettings(Settings):
    """The analytic level: milliseconds a run."""

    name: str = Field(min_length=1)
    engine: Literal["reduced"]
    grains: int = Field(default=1000, ge=50)


class CommandLevelSettings(Settings):
    """A program of the user's own: JSON on its standard input, JSON on its standard output."""

    name: str = Field(min_length=1)
    engine: Literal["command"]
    command: list[str] = Field(min_length=1)
    work: float = Field(default=1.0, gt=0.0)  # of one run, relative to the other levels
    time_limit_s: float = Field(default=3600.0, gt=0.0)


@dataclass(frozen=True, slots=True, eq=False)
class Assembled:
    """A study, ready to run."""

    problem: Problem
    ladder: Ladder
    confirm_on: Ladder  # the same levels, with snapshots of the grains
    dosing: DosingSettings | None  # None for a problem of the user's own
    described: tuple[Mapping[str, Any], ...]  # per level: engine, grains, spheres_per_grain
    versions: Mapping[str, str]  # of the engines


def assemble(study: Study, *, where: str) -> Assembled:
    """Build the problem and the levels that a study names.

    Args:
        study: the study.
        where: its file, for messages.

    Raises:
        ConfigError: if a table is wrong, or an engine is not installed.
    """
    dosing = _dosing(study.problem, where)
    problem = dosing_problem(dosing) if dosing else _own_problem(study.problem, where)
    made = [
        _level(table, dosing, problem, f"{where}: level {number}")
        for number, table in enumerate(study.level, start=1)
    ]
    levels = tuple(level for level, _ in made)
    detailed = tuple(
        replace(level, snapshots=SNAPSHOTS) if isinstance(level, DosingLevel) else level
        for level in levels
    )
    versions = {
        level.engine.name: level.engine.version()
        for level in levels
        if isinstance(level, DosingLevel)
    }
    described = tuple(description for _, description in made)
    return Assembled(problem, Ladder(levels), Ladder(detailed), dosing, described, versions)


def _dosing(settings: ProblemSettings, where: str) -> DosingSettings | None:
    if settings.scene is None:
        if settings.dosing:
            raise ConfigError(f'{where}: [problem.dosing] needs scene = "dosing" in [problem]')
        return None
    if settings.variable:
        raise ConfigError(
            f"{where}: a scene brings its own variables; free them in [problem.dosing.free] "
            "instead of [[problem.variable]]"
        )
    return checked(DosingSettings, settings.dosing, where=f"{where}: problem.dosing")


def _own_problem(settings: ProblemSettings, where: str) -> Problem:
    if not settings.variable:
        raise ConfigError(
            f'{where}: the problem has no variables; give scene = "dosing" or [[problem.variable]]'
        )
    variables = tuple(Variable(v.name, v.lower, v.upper, v.unit) for v in settings.variable)
    start = [(v.lower + v.upper) / 2.0 if v.start is None else v.start for v in settings.variable]
    return Problem(variables, frozen(start), objective_unit=settings.objective_unit)


def _level(
    table: Mapping[str, Any], dosing: DosingSettings | None, problem: Problem, where: str
) -> tuple[Level, Mapping[str, Any]]:
    engine = table.get("engine")
    match engine:
        case "command":
            own = checked(CommandLevelSettings, table, where=where)
            level = CommandLevel(
                own.name, tuple(own.command), problem.names, own.work, own.time_limit_s
            )
            level.check()
            return level, {"engine": "command"}
        case "reduced":
            reduced = checked(ReducedLevelSettings, table, where=where)
            scene = _needs_dosing(dosing, "reduced", where)
            return (
                ReducedDosing(reduced.name, scene, reduced.grains),
                {"engine": "reduced", "grains": reduced.grains},
            )
        case "yade" | "bullet" | list():
            dem = checked(DemLevelSettings, table, where=where)
            scene = _needs_dosing(dosing, str(engine), where)
            return _dosing_level(dem, scene, where)
        case _:
            raise ConfigError(
                f"{where}: engine = {engine!r} must be one of 'reduced', 'bullet', 'yade', "
                "'command', or a list of 'yade' and 'bullet' in order of preference"
            )


def _dosing_level(
    settings: DemLevelSettings, dosing: DosingSettings, where: str
) -> tuple[DosingLevel, Mapping[str, Any]]:
    engine = _first_installed(settings, where)
    numerics = {name: getattr(settings, name) for name in DemSettings.model_fields}
    level = DosingLevel(settings.name, dosing, DemSettings(**numerics), engine)
    return level, {
        "engine": engine.name,
        "grains": settings.grains,
        "spheres_per_grain": settings.spheres_per_grain,
    }


def _first_installed(settings: DemLevelSettings, where: str) -> Engine:
    names = settings.engine if isinstance(settings.engine, list) else [settings.engine]
    problems = []
    for name in names:
        engine: Engine = YadeEngine(settings.precision) if name == "yade" else BulletEngine()
        try:
            engine.version()
        except ConfigError as error:
            problems.append(str(error))
        else:
            return engine
    raise ConfigError(f"{where}: {'; '.join(problems) or 'no engine is named'}")


def _needs_dosing(dosing: DosingSettings | None, engine: str, where: str) -> DosingSettings:
    if dosing is None:
        raise ConfigError(f'{where}: engine {engine!r} needs scene = "dosing" in [problem]')
    return dosing


def traced(level: Level, directory: Path) -> Level:
    """The same level, writing VTK files of its runs into `directory`; no result changes.

    Raises:
        ConfigError: if the level's engine cannot.
    """
    if not (isinstance(level, DosingLevel) and isinstance(level.engine, YadeEngine)):
        raise ConfigError(f"level {level.name!r} writes no trace; choose one on the engine yade")
    return replace(level, engine=replace(level.engine, trace=directory))
