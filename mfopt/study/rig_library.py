"""From a case to the library of its rig: the runs from which missing effects are told apart."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from calibration.diagnosis.library import Library
from calibration.diagnosis.suspects import effect_of
from calibration.rig import Conditions
from mfopt.arrays import frozen
from mfopt.errors import ConfigError
from mfopt.files.array_file import digest
from mfopt.records.level import Ladder
from mfopt.records.problem import Problem, Variable
from mfopt.study.case import AssembledCase

SEED = 1  # of all libraries: one serves all cases of a rig


@dataclass(frozen=True, slots=True, eq=False)
class AssembledLibrary:
    """The library of a rig, ready to be run."""

    library: Library
    problem: Problem  # base parameters and effects as variables
    experiments: Mapping[str, str]  # of each recording, by its name
    conditions: Mapping[str, Conditions]  # of each experiment
    ladder: Ladder  # the rig under the conditions of each experiment, by its name
    confirming: Ladder  # the same for each recording, by the name of the recording
    meaning: Mapping[str, Any]  # what its runs depend on beside conditions and ranges

    @property
    def absent(self) -> Mapping[str, float]:
        """Every parameter of a run without effects, the base ones amid their ranges."""
        return self.problem.named(self.problem.baseline)


def assemble_library(parts: AssembledCase, *, further: bool) -> AssembledLibrary:
    """The library of a case; with `further` also of the experiments that could be recorded next.

    Raises:
        ConfigError: if the rig has no effects, or an effect is no parameter of it.
    """
    fitted = {p.name.partition(".")[0] for p in parts.case.parameters}
    effects = tuple(effect_of(e) for name, e in parts.rig.effects.items() if name not in fitted)
    if not effects:
        raise ConfigError(
            "the case names no effects that may be missing; add a table [effects] with the "
            "parameters of the simulator that switch them on"
        )
    library = Library(parts.case.parameters, effects, SEED)
    recorded = {r.name: r.conditions for r in parts.case.recordings}
    experiments = {name: _called(its) for name, its in recorded.items()}
    conditions = {experiments[name]: its for name, its in recorded.items()}
    if further:
        possible = (parts.conditions[level.name] for level in parts.possible)
        conditions |= {_called(its): its for its in possible if _called(its) not in conditions}
    rig, names = parts.rig, library.names
    return AssembledLibrary(
        library,
        _problem(library),
        experiments,
        conditions,
        Ladder(tuple(rig.level(name, its, names) for name, its in conditions.items())),
        Ladder(tuple(rig.level(name, its, names) for name, its in recorded.items())),
        {key: value for key, value in parts.meaning.items() if key != "fit"},
    )


def rig_digest(its: AssembledLibrary) -> str:
    """What the library of a rig is called where no name is given."""
    text = repr((sorted(its.meaning.items()), its.problem.variables))
    return digest(text.encode())[:12]


def _problem(library: Library) -> Problem:
    variables = [Variable(p.name, p.low, p.high, p.unit) for p in library.parameters]
    middle = [(p.low + p.high) / 2.0 for p in library.parameters]
    for its in library.effects:
        for name, value in its.absent.items():
            low, high = (its.low, its.high) if name == its.varies else (value, value)
            variables.append(Variable(name, low, max(high, low + _width(low)), its.unit))
            middle.append(value)
    return Problem(tuple(variables), frozen(middle))


def _width(low: float) -> float:
    """A range for a number that has one value only."""
    return max(abs(low), 1.0) * 1e-6


def _called(its: Conditions) -> str:
    """What an experiment is called: by its conditions, so that all cases call it alike."""
    named = (f"{k} = {v if isinstance(v, str) else f'{v:g}'}" for k, v in sorted(its.items()))
    return ", ".join(named) or "as the case says"
