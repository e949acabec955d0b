"""From a case file to recordings, parameters and the simulator that they are compared with."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pydantic import Field, field_validator

from calibration.recordings.case import Case, Parameter
from calibration.recordings.case_file import complete_case
from calibration.recordings.case_settings import CaseSettings, read_case_settings
from calibration.recordings.noise import measurement_noise
from calibration.recordings.records import Noise
from calibration.recordings.units import si_units, unit_of
from calibration.rig import Conditions, Rig
from fidelity.engine import Engine
from fidelity.programs.rig import ProgramRig
from fidelity.rig import SCENE, SceneRig
from fidelity.scenes.beads import Vessel
from mfopt.arrays import frozen
from mfopt.errors import ConfigError, InvalidDesign
from mfopt.files.array_file import digest
from mfopt.limits import Name, TimeLimit, Word
from mfopt.records.effect import Effect
from mfopt.records.level import Ladder, Level
from mfopt.records.objective import Criteria, Objective
from mfopt.records.outcome import why_not_a_name
from mfopt.records.problem import Problem, Variable
from mfopt.records.rig import TIME, Channel
from mfopt.settings import Settings, checked
from mfopt.study.assemble import SCENES, DemName, EngineOptions, engine_named, refuse_options

OTHERS = (TIME, "work")  # names in the answer of a program that are no channels
# A calibration compares series; its runs have no value of their own.
COMPARED = Criteria({"none": Objective("none", lambda raw: {"none": 0.0})})


class SceneRigSettings(Settings):
    """The table `rig` of a case whose experiment is a scene of mfopt."""

    scene: str
    engine: DemName = "numba"
    coarse: float = Field(default=1.0, ge=1.0, le=10.0)  # diameter of simulated over real grains
    stiffness_factor: float = Field(default=6.0, ge=1.0, le=100.0)  # by which E may be wrong
    grains: dict[str, Any] = Field(default_factory=dict)  # size and material, for all scenes
    level: dict[str, Any] = Field(default_factory=dict)  # numerics, as of a level of a study
    tables: dict[str, dict[str, Any]] = Field(default_factory=dict)  # of scenes, by name


@dataclass(frozen=True, slots=True, eq=False)
class AssembledCase:
    """A case, ready to be calibrated."""

    case: Case
    rig: Rig
    problem: Problem  # the parameters as variables
    ladder: Ladder  # the rig under the conditions of each recording, by its name
    possible: tuple[Level, ...]  # further experiments, by what they are called
    noises: Mapping[str, Noise]  # by channel
    text: str  # of the case file
    meaning: Mapping[str, Any]  # what runs depend on beside conditions and ranges; `fit`: the rest
    conditions: Mapping[str, Conditions]  # of each recording and further experiment, by its name
    doubts: tuple[str, ...]  # why simulations may be wrong, or what is stated, in words


def assemble_case(path: Path) -> AssembledCase:
    """Read a case and its recordings, and build its simulator.

    Raises:
        ConfigError: if the case or a recording cannot be trusted, or the simulator is missing.
    """
    settings, text = read_case_settings(path)
    chosen = {str(r.conditions[SCENE]) for r in settings.recording if SCENE in r.conditions}
    effects = {name: its.named(name) for name, its in settings.effects.items()}
    rig = _rig(settings.rig, path, chosen, effects)
    case = complete_case(settings, path, rig.channels)
    case = replace(case, parameters=_parameters(case, rig, path))
    names = tuple(p.name for p in case.parameters)
    ladder = Ladder(tuple(rig.level(r.name, r.conditions, names) for r in case.recordings))
    problem = Problem(
        tuple(Variable(p.name, p.low, p.high, p.unit) for p in case.parameters),
        frozen([(p.low + p.high) / 2.0 for p in case.parameters]),
    )
    given = {p.name: p.conditions for p in settings.possible}
    further = _levels(rig, given, names) if given else _possible_levels(rig, names)
    recorded = {r.name: r.conditions for r in case.recordings}
    conditions: dict[str, Conditions] = {**recorded, **(given or rig.possible)}
    channels = sorted({c for recording in case.recordings for c in recording.channels})
    noises = {c: measurement_noise(case.recordings, c, case.measurement.of(c)) for c in channels}
    meaning = {**_meaning(path, case, rig), "fit": _fit(path, settings)}
    doubts = [f"{r.name}: {why}" for r in case.recordings for why in rig.doubts(r.conditions)]
    overruled = (n for n in noises.values() if n.found.endswith(" stated"))
    doubts += [f"{n.channel}: the noise is taken {n.found}" for n in overruled]
    return AssembledCase(
        case, rig, problem, ladder, further, noises, text, meaning, conditions, tuple(doubts)
    )


def _parameters(case: Case, rig: Rig, path: Path) -> tuple[Parameter, ...]:
    """The parameters of the case, and those that the rig cannot know.

    Raises:
        ConfigError: if a range is impossible, or a unit is not that of the rig.
    """
    found = []
    for given in case.parameters:
        its = rig.parameter(given.name)
        if its is None:
            found.append(given)
            continue
        if given.unit not in ("-", its.unit):
            raise ConfigError(
                f"{path}: parameters.{given.name}: unit = {given.unit!r} must be {its.unit!r}, as "
                "in the scene; leave it out, and give the range in that unit"
            )
        if its.log and given.low <= 0.0:
            raise ConfigError(
                f"{path}: parameters.{given.name}: range starts at {given.low:g}, which must be "
                "above 0; its logarithm is fitted"
            )
        found.append(replace(given, log=its.log, unit=its.unit))
    for name, (low, high) in rig.unsure.items():
        its = rig.parameter(name)
        if its is not None and name not in {p.name for p in found}:
            found.append(Parameter(name, low, high, log=its.log, unit=its.unit, asked=False))
    return tuple(found)


def _levels(
    rig: Rig, conditions: Mapping[str, Conditions], parameters: tuple[str, ...]
) -> tuple[Level, ...]:
    return tuple(rig.level(name, its, parameters) for name, its in conditions.items())


def _possible_levels(rig: Rig, parameters: tuple[str, ...]) -> tuple[Level, ...]:
    """Those of the experiments that a rig proposes which can be built with these grains."""
    made: list[Level] = []
    for name, conditions in rig.possible.items():
        try:
            made += _levels(rig, {name: conditions}, parameters)
        except (ConfigError, InvalidDesign):
            continue
    return tuple(made)


class ChannelSettings(Settings):
    """A channel that the user's own simulator gives."""

    unit: str  # SI
    size: float = Field(gt=0.0)  # typical largest value

    @field_validator("unit")
    @classmethod
    def _is_si(cls, unit: str) -> str:
        its = unit_of(unit)
        if its is None:
            raise ValueError(f"{unit!r} is no unit of a channel; give {', '.join(si_units())}")
        if its.factor != 1.0:
            raise ValueError(
                f"{unit!r} must be the SI unit {its.si!r}; let the simulator give the channel in "
                f"{its.si}, and size too. Recordings may have {unit!r}: they are converted"
            )
        return its.si


class ProgramRigSettings(Settings):
    """The table `rig` of a case whose simulator is the user's own."""

    command: list[Word] = Field(default_factory=list)
    function: Word = ""  # FILE.py:NAME, the file beside the case
    channels: dict[Name, ChannelSettings] = Field(min_length=1)
    time_limit_s: TimeLimit = 3600.0

    @field_validator("channels")
    @classmethod
    def _kept(cls, channels: dict[str, ChannelSettings]) -> dict[str, ChannelSettings]:
        for name in channels:
            if (why := why_not_a_name(name)) is not None:
                raise ValueError(why)
            if name in OTHERS:
                raise ValueError(
                    f"{name!r} is not a channel but what a run gives beside them; rename it"
                )
        return channels


def _rig(
    table: Mapping[str, Any], path: Path, chosen: set[str], effects: Mapping[str, Effect]
) -> Rig:
    """The simulator that a case names; `chosen` are the scenes that its recordings choose.

    Raises:
        ConfigError: if the table is wrong, or the simulator is missing.
    """
    if "command" in table or "function" in table:
        return replace(_program(table, path), effects=effects)
    if effects:
        raise ConfigError(
            f"{path}: effects: those of a scene are built in; leave the table out, or give a "
            "simulator of your own (rig.function or rig.command)"
        )
    return _scenes({**{name: {} for name in SCENES if name in chosen}, **table}, str(path))


def _program(table: Mapping[str, Any], path: Path) -> ProgramRig:
    its = checked(ProgramRigSettings, table, where=f"{path}: rig")
    if bool(its.command) == bool(its.function):
        raise ConfigError(f"{path}: rig: give either command or function")
    channels = {name: Channel(name, c.unit, c.size) for name, c in its.channels.items()}
    file, _, name = its.function.partition(":")
    function = (str((path.parent / file).absolute()), name) if file else ("", "")
    return ProgramRig(channels, tuple(its.command), function, its.time_limit_s)


def _scenes(table: Mapping[str, Any], where: str) -> SceneRig:
    tables = {name: table[name] for name in SCENES if name in table}
    rest = {key: value for key, value in table.items() if key not in SCENES}
    its = checked(SceneRigSettings, {**rest, "tables": tables}, where=f"{where}: rig")
    if its.scene not in SCENES:
        raise ConfigError(f"{where}: rig.scene = {its.scene!r} must be one of {', '.join(SCENES)}")
    for name in its.grains:
        if name not in Vessel.model_fields:
            raise ConfigError(
                f"{where}: rig.grains has no key {name!r}; give "
                f"{', '.join(k for k in Vessel.model_fields if k != 'free')}"
            )
    said = {key: value for key, value in its.level.items() if key in EngineOptions.model_fields}
    options = checked(EngineOptions, said, where=f"{where}: rig.level")
    numerics = {key: value for key, value in its.level.items() if key not in said}
    engine = _engine(its.engine, options, f"{where}: rig")
    return SceneRig(
        SCENES, its.scene, its.tables, its.grains, numerics, engine,
        its.coarse, its.stiffness_factor,
    )  # fmt: skip


def _engine(name: DemName, options: EngineOptions, where: str) -> Engine:
    try:
        refuse_options([name], options)
        engine = engine_named(name, options)
        engine.version()
    except ConfigError as error:
        raise ConfigError(f"{where}: {error}") from error
    return engine


def _meaning(path: Path, case: Case, rig: Rig) -> dict[str, Any]:
    """What no run may differ in: the rig, the content of the user's program, the priors."""
    its: dict[str, Any] = {
        "rig": case.rig,
        "prior": {p.name: None if p.mean is None else [p.mean, p.sd] for p in case.parameters},
    }
    for name, file in rig.files.items() if isinstance(rig, ProgramRig) else ():
        its[f"content of {name}"] = digest(file.read_bytes())[:16]
    return its


def _fit(path: Path, settings: CaseSettings) -> str:
    """Digest of what only decides which runs are asked for: recordings and how they are read."""
    tables = settings.model_dump_json(include={"measurement", "csv", "recording", "possible"})
    files = sorted({file for its in settings.recording for file in its.files})
    contents = [digest((path.parent / file).read_bytes()) for file in files]
    return digest("\n".join([tables, *contents]).encode())
