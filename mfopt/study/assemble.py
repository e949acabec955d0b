"""From a study's tables to a problem and a ladder: the one place that knows every engine."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, cast, get_args

from pydantic import Field

from fidelity.engine import Engine
from fidelity.engines.bullet.engine import BulletEngine
from fidelity.engines.numba import NumbaEngine
from fidelity.engines.yade.engine import YadeEngine
from fidelity.grains.settings import DemSettings
from fidelity.level import SceneLevel
from fidelity.programs.command import CommandLevel
from fidelity.scene import Scene, read_scene
from fidelity.scenes.discharge.scene import Discharge
from fidelity.scenes.dosing.scene import Dosing
from fidelity.scenes.heap.scene import Heap
from fidelity.scenes.silo.scene import Silo
from mfopt.arrays import frozen
from mfopt.campaign.phases import Starts
from mfopt.errors import ConfigError
from mfopt.limits import Grains, Name, TimeLimit, Word, Work
from mfopt.records.evaluation import Reference
from mfopt.records.level import Ladder, Level
from mfopt.records.objective import OWN, Criteria
from mfopt.records.problem import Problem, Variable
from mfopt.search.search import rungs
from mfopt.search.swap import check_pair
from mfopt.settings import Settings, checked, nearest
from mfopt.study.file import ProblemSettings, Study

START_SHARE = 0.25  # of the budget that starts may cost, where one seed each allows it
START_SEEDS = 3  # on which starts are compared, if the search has so many
SNAPSHOTS = 4  # moments of the best run that the report shows

Precision = Literal["double", "longdouble", "float128"]
# Every scene is a line here.
SCENES: Mapping[str, type[Scene]] = {kind.name: kind for kind in (Dosing, Discharge, Heap, Silo)}

DemName = Literal["numba", "yade", "bullet"]
DEM_NAMES = get_args(DemName)


class EngineOptions(Settings):
    """What a level says to one engine alone; `engine_named` hands each option to its engine."""

    precision: Precision = "double"


OPTION_OF: Mapping[str, DemName] = {"precision": "yade"}  # the engine that has the option


class Numerics(DemSettings, EngineOptions):
    """What a level says of grains, numerics and engine."""


class DemLevelSettings(Numerics):
    """A level on a discrete-element engine; of several engines the first installed one runs."""

    name: Name
    engine: DemName | list[DemName]


class ReducedLevelSettings(Settings):
    """The analytic level: milliseconds a run."""

    name: Name
    engine: Literal["reduced"]
    grains: Annotated[Grains, Field(ge=50)] = 1000


class CommandLevelSettings(Settings):
    """A program of the user's own: JSON on its standard input, JSON on its standard output."""

    name: Name
    engine: Literal["command"]
    command: list[Word] = Field(min_length=1)
    work: Work = 1.0  # of one run, relative to the other levels
    time_limit_s: TimeLimit = 3600.0


@dataclass(frozen=True, slots=True, eq=False)
class Assembled:
    """A study, ready to run."""

    problem: Problem
    ladder: Ladder
    confirm_on: Ladder  # the same levels, with snapshots of the grains
    scene: Scene | None  # None for a problem of the user's own
    criteria: Criteria  # how its runs are judged
    described: tuple[Mapping[str, Any], ...]  # per level: engine, grains, spheres_per_grain
    versions: Mapping[str, str]  # of the engines
    starts: Starts | None  # designs that the search may start from; None: the baseline alone
    reference: Reference | None  # what the study asks for beside the ladder, and what came of it
    reference_level: Level | None  # where best and baseline are run once more, if anywhere

    @property
    def all_levels(self) -> Ladder:
        """The ladder, with the reference above it."""
        return Ladder((*self.ladder, *filter(None, [self.reference_level])))

    @property
    def uses_numba(self) -> bool:
        """Whether a run may call the compiled engine, be it only to fill the vessel."""
        return any(isinstance(level, SceneLevel) for level in self.ladder)


def assemble(study: Study, *, where: str) -> Assembled:
    """Build the problem and the levels that a study names.

    Args:
        study: the study.
        where: its file, for messages.

    Raises:
        ConfigError: if a table is wrong, or an engine is not installed.
    """
    scene = scene_of(study.problem, where)
    problem = scene.problem() if scene else _own_problem(study.problem, where)
    criteria = scene.criteria() if scene else OWN
    _check_objectives(study, criteria, where)
    _check_exchange(study, problem, where)
    made = []
    for number, table in enumerate(study.level, start=1):
        # The reference takes the options of the target.
        beside = study.confirm.references if number == len(study.level) else ()
        made.append(_level(table, scene, problem, f"{where}: level {number}", beside))
    levels = tuple(level for level, _ in made)
    detailed = tuple(
        replace(level, snapshots=SNAPSHOTS) if isinstance(level, SceneLevel) else level
        for level in levels
    )
    versions = {
        engine.name: engine.version()
        for level in levels
        if isinstance(level, SceneLevel)
        for engine in (level.engine, level.filler)
    }
    described = tuple(description for _, description in made)
    ladder = Ladder(levels)
    if study.search.method == "assisted":
        _check_order(ladder, problem, where)
    reference, reference_level = _reference(study, ladder, f"{where}: confirm.reference")
    return Assembled(
        problem, ladder, Ladder(detailed), scene, criteria, described, versions,
        None if scene is None else _starts(study, scene, problem, ladder), reference,
        reference_level,
    )  # fmt: skip


def _starts(study: Study, scene: Scene, problem: Problem, ladder: Ladder) -> Starts | None:
    """The designs that an engineer would try first, compared at the first level with grains."""
    designs = scene.starts(problem)
    if len(designs) == 1:
        return None
    level = next((level for level in ladder if isinstance(level, SceneLevel)), ladder.levels[0])
    seeds = min(study.search.seeds, START_SEEDS)
    if (budget := study.search.budget) is not None:
        work = len(designs) * level.work(problem.baseline)
        most = START_SHARE * budget * ladder.top.work(problem.baseline) / work
        seeds = max(1, min(seeds, int(most)))
    return Starts(designs, level.name, seeds)


def _check_order(ladder: Ladder, problem: Problem, where: str) -> None:
    try:
        rungs(ladder, problem.baseline)
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from error


def _check_exchange(study: Study, problem: Problem, where: str) -> None:
    try:
        check_pair(problem, study.search.exchange)
    except ConfigError as error:
        raise ConfigError(f"{where}: search: {error}") from error


def scene_of(settings: ProblemSettings, where: str) -> Scene | None:
    """The scene that a study names, with its settings; None for a problem of the user's own.

    Raises:
        ConfigError: if there is no such scene, or a key is wrong.
    """
    if settings.scene is None:
        _refuse_others(settings, where)
        return None
    try:
        kind = scene_class(settings.scene)
    except ConfigError as error:
        raise ConfigError(f"{where}: problem.scene: {error}") from error
    if "objective_unit" in settings.model_fields_set:
        raise ConfigError(
            f"{where}: problem.objective_unit = {settings.objective_unit!r}: a scene brings the "
            "unit of its objectives; leave the key out"
        )
    if settings.variable:
        raise ConfigError(
            f"{where}: a scene brings its own variables; free them in [problem.{kind.name}.free] "
            "instead of [[problem.variable]]"
        )
    wanted = settings.others
    own = wanted.pop(kind.name, {})
    if not isinstance(own, Mapping):
        raise ConfigError(f"{where}: problem.{kind.name} = {own!r} must be a table")
    return read_scene(kind, own, wanted, where)


def scene_class(name: str) -> type[Scene]:
    """The scene of that name.

    Raises:
        ConfigError: if there is none.
    """
    if not isinstance(name, str) or name not in SCENES:
        raise ConfigError(f"there is no scene {name!r}{nearest(str(name), SCENES)}")
    return SCENES[name]


def _refuse_others(settings: ProblemSettings, where: str) -> None:
    for key in settings.others:
        if key in SCENES:
            raise ConfigError(f"{where}: [problem.{key}] needs scene = {key!r} in [problem]")
        known = [*ProblemSettings.model_fields, *SCENES]
        raise ConfigError(f"{where}: unknown key 'problem.{key}'{nearest(key, known)}")


def _check_objectives(study: Study, criteria: Criteria, where: str) -> None:
    """Refuse objectives that the problem does not have."""
    staged = [stage.objective for stage in study.search.stage if stage.objective is not None]
    for name in (study.problem.objective, *staged):
        try:
            criteria.objective(name)
        except ConfigError as error:
            raise ConfigError(f"{where}: {error}") from error


def _own_problem(settings: ProblemSettings, where: str) -> Problem:
    if not settings.variable:
        raise ConfigError(
            f"{where}: the problem has no variables; give a scene or [[problem.variable]]"
        )
    variables = tuple(Variable(v.name, v.lower, v.upper, v.unit) for v in settings.variable)
    start = [(v.lower + v.upper) / 2.0 if v.start is None else v.start for v in settings.variable]
    return Problem(variables, frozen(start), objective_unit=settings.objective_unit)


def _level(
    table: Mapping[str, Any],
    scene: Scene | None,
    problem: Problem,
    where: str,
    beside: Sequence[str],
) -> tuple[Level, Mapping[str, Any]]:
    settings = level_settings(table, where)
    match settings:
        case CommandLevelSettings():
            level = CommandLevel(
                settings.name,
                tuple(settings.command),
                problem.names,
                settings.work,
                settings.time_limit_s,
            )
            level.check()
            return level, {"engine": "command"}
        case ReducedLevelSettings():
            reduced = _needs_scene(scene, where).reduced(settings.name, settings.grains)
            if reduced is None:
                raise ConfigError(
                    f"{where}: the scene has no reduced model; choose one of {_listed(DEM_NAMES)}"
                )
            return reduced, {"engine": "reduced", "grains": settings.grains}
        case DemLevelSettings():
            return _scene_level(settings, _needs_scene(scene, where), problem, where, beside)


def level_settings(
    table: Mapping[str, Any], where: str
) -> CommandLevelSettings | ReducedLevelSettings | DemLevelSettings:
    """What a table of a study says of a level, with what it leaves out filled in.

    Raises:
        ConfigError: if the engine is none, or a key is wrong.
    """
    match engine := table.get("engine"):
        case "command":
            return checked(CommandLevelSettings, table, where=where)
        case "reduced":
            return checked(ReducedLevelSettings, table, where=where)
        case "numba" | "yade" | "bullet" | list():
            return checked(DemLevelSettings, table, where=where)
        case _:
            raise ConfigError(
                f"{where}: engine = {engine!r} must be one of 'reduced', {_listed(DEM_NAMES)}, "
                f"'command', or a list of {_listed(DEM_NAMES)} in order of preference"
            )


def drawn(study: Study, *, where: str) -> tuple[Scene, DemSettings | None] | None:
    """The scene of a study and the grains of its target level, as far as a picture needs them.

    No engine is asked for, so that a run can be looked at where its engine is not installed.

    Returns:
        None for a problem of the user's own; no grains for a target level without any.

    Raises:
        ConfigError: if a table is wrong.
    """
    scene = scene_of(study.problem, where)
    if scene is None:
        return None
    target = level_settings(study.level[-1], f"{where}: level {len(study.level)}")
    return scene, target if isinstance(target, DemLevelSettings) else None


def _scene_level(
    settings: DemLevelSettings,
    scene: Scene,
    problem: Problem,
    where: str,
    beside: Sequence[str],
) -> tuple[SceneLevel, Mapping[str, Any]]:
    names = settings.engine if isinstance(settings.engine, list) else [settings.engine]
    dem = DemSettings(**{name: getattr(settings, name) for name in DemSettings.model_fields})
    try:
        refuse_options([*names, *beside], settings)
        engine = _first_installed([engine_named(name, settings) for name in names])
        level = SceneLevel(settings.name, scene, dem, engine)
        scene.portion(problem.baseline, dem)  # refuses impossible effects on grains
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from error
    return level, {
        "engine": engine.name,
        "grains": settings.grains,
        "spheres_per_grain": settings.spheres_per_grain,
    }


def _first_installed(engines: Sequence[Engine]) -> Engine:
    problems = []
    for engine in engines:
        try:
            engine.version()
        except ConfigError as error:
            problems.append(str(error))
        else:
            return engine
    raise ConfigError("; ".join(problems) or "no engine is named")


def _reference(study: Study, ladder: Ladder, where: str) -> tuple[Reference | None, Level | None]:
    """The top level on the engine that the study names for reference, with what to say of it."""
    names = study.confirm.references
    if not names:
        return None, None
    top = _on_grains(ladder.top, names, where)
    options = level_settings(study.level[-1], where)
    assert isinstance(options, DemLevelSettings)
    engines = [e for n in names if (e := _dem_engine(n, options, where)).name != top.engine.name]
    if not engines:
        return Reference(why_not=f"the target level runs on {top.engine.name} itself"), None
    try:
        engine = _first_installed(engines)
    except ConfigError as error:
        return Reference(why_not=f"{error}; once it is there, --resume adds the run"), None
    level = replace(top, name=f"{top.name}-{engine.name}", engine=engine)
    if level.name in ladder.names:
        raise ConfigError(f"{where}: its runs are called {level.name!r}; rename that level")
    return Reference(level.name, engine.name, engine.version()), level


def _on_grains(top: Level, names: Sequence[str], where: str) -> SceneLevel:
    if not isinstance(top, SceneLevel):
        raise ConfigError(
            f"{where} = {', '.join(names)}: the target level {top.name!r} has no grains that such "
            "an engine could move; give a scene in [problem] and a target level on "
            f"{_listed(DEM_NAMES)}, or leave the reference out"
        )
    return top


def _dem_engine(name: str, options: EngineOptions, where: str) -> Engine:
    if name not in DEM_NAMES:
        raise ConfigError(f"{where} = {name!r} must be one of {_listed(DEM_NAMES)}")
    return engine_named(cast(DemName, name), options)


def _listed(names: Sequence[str]) -> str:
    return ", ".join(map(repr, names))


def refuse_options(names: Sequence[str], options: EngineOptions) -> None:
    """Refuse options that none of the engines of these names has.

    Raises:
        ConfigError: names the option and its engine.
    """
    for option, engine in OPTION_OF.items():
        if option in options.model_fields_set and engine not in names:
            raise ConfigError(
                f"{option} = {getattr(options, option)!r} is an option of the engine {engine!r}, "
                f"not of {_listed(names)}; leave it out or choose {engine!r}"
            )


def engine_named(name: DemName, options: EngineOptions | None = None) -> Engine:
    """The engine of that name, with those of the options that are its own."""
    its = EngineOptions() if options is None else options
    match name:
        case "numba":
            return NumbaEngine()
        case "yade":
            return YadeEngine(its.precision)
        case "bullet":
            return BulletEngine()


def _needs_scene(scene: Scene | None, where: str) -> Scene:
    if scene is None:
        raise ConfigError(
            f"{where}: its engine moves grains, and [problem] names no scene; give scene = one of "
            f"{_listed(tuple(SCENES))}, or an engine 'command'"
        )
    return scene


def traced(level: Level, directory: Path) -> Level:
    """The same level, writing VTK files of its runs into `directory`; no result changes.

    Raises:
        ConfigError: if the level's engine cannot.
    """
    if not (isinstance(level, SceneLevel) and isinstance(level.engine, YadeEngine)):
        raise ConfigError(f"level {level.name!r} writes no trace; choose one on the engine yade")
    return replace(level, engine=replace(level.engine, trace=directory))
