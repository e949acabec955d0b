"""The user's own simulator of an experiment: a command or a Python function.

A command gets JSON as in `fidelity.programs.command`, with the parameters in `x` and the table
`conditions` of the recording. A function `f(parameters, conditions, seed)` gets both as
dictionaries. Both give the times `time` (s,) [s], each series over them, and numbers, by channel.
A function is interrupted at the time limit between two instructions of Python; a call into
compiled code ends first. What a function prints is not shown, but for the last lines in the reason
of a failed run.
"""

import importlib.util
import os
import signal
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from time import process_time
from types import ModuleType
from typing import Any

import numpy as np

from fidelity.programs.command import CommandLevel, why_not_finite
from fidelity.programs.function import explained, from_terminal
from fidelity.programs.printed import captured
from mfopt.arrays import AnyArray, Array, frozen
from mfopt.checks import shown
from mfopt.errors import ConfigError
from mfopt.records.effect import Effect
from mfopt.records.level import Level
from mfopt.records.outcome import Outcome, Status
from mfopt.records.rig import TIME, Channel, RigParameter

Conditions = Mapping[str, float | str]
FAR = 1e6  # times the usual size of a channel: one run so far off hides all others
AGAIN = 1.0  # [s] after which a function that caught the interruption is interrupted again


@dataclass(frozen=True, slots=True)
class ProgramRig:
    """A simulator of the user's own. Implements `calibration.rig.Rig`."""

    channels: Mapping[str, Channel]
    command: tuple[str, ...] = ()  # to be run; empty: there is a function
    function: tuple[str, str] = ("", "")  # file and name
    time_limit_s: float = 3600.0
    effects: Mapping[str, Effect] = field(default_factory=dict)  # which the user names

    @property
    def unsure(self) -> Mapping[str, tuple[float, float]]:
        """None: what is fitted is the user's to say."""
        return {}

    @property
    def possible(self) -> Mapping[str, Mapping[str, float | str]]:
        """None: which experiments there could be is the user's to say."""
        return {}

    def doubts(self, conditions: Conditions) -> tuple[str, ...]:
        """Nothing is known of what a program lacks."""
        return ()

    def parameter(self, name: str) -> RigParameter | None:
        """Nothing is known of the parameters of a program."""
        return None

    @property
    def files(self) -> dict[str, Path]:
        """Files of the program, by name: what a run depends on beside its parameters.

        Of a function its file and the neighbours that this imports at its top; of a command the
        program, if it is named with its folder, and every file among its words.

        Raises:
            ConfigError: if the function cannot be loaded.
        """
        if not self.command:
            folder = os.path.dirname(self.function[0])
            its = _module(self.function[0])[1]
            return {os.path.relpath(file, folder): Path(file) for file in its}
        program = self.command[:1] if os.sep in self.command[0] else ()
        words = (*program, *self.command[1:])
        return {word: Path(word) for word in words if os.path.isfile(word)}

    def level(
        self, name: str, conditions: Conditions, parameters: tuple[str, ...]
    ) -> "ProgramLevel":
        """The program under these conditions.

        Raises:
            ConfigError: if it is missing.
        """
        if not self.command:
            _loaded(*self.function)
            runs: Level = FunctionRun(
                name, self.function, parameters, conditions, self.time_limit_s
            )
        else:
            command = CommandLevel(
                name, self.command, parameters, 1.0, self.time_limit_s, conditions
            )
            command.check()
            runs = command
        return ProgramLevel(runs, self.channels)


@dataclass(frozen=True, slots=True)
class ProgramLevel:
    """A program that must give the channels which the case names. A `Level`."""

    program: Level
    channels: Mapping[str, Channel]

    @property
    def name(self) -> str:
        """Name of the recording."""
        return self.program.name

    def work(self, x: Array) -> float:
        """Work of a run."""
        return self.program.work(x)

    def evaluate(self, x: Array, *, seed: int) -> Outcome:
        """Run once; a run whose series do not fit to their times has crashed."""
        outcome = self.program.evaluate(x, seed=seed)
        why = self._flaw(outcome.raw) if outcome.finished else None
        return outcome if why is None else replace(outcome, status="crashed", why=why, raw={})

    def _flaw(self, raw: Mapping[str, AnyArray]) -> str | None:
        given = [name for name in self.channels if name in raw]
        if not given:
            return f"the program gives none of the channels {', '.join(self.channels)}"
        for name in given:
            largest, its = float(np.abs(raw[name]).max(initial=0.0)), self.channels[name]
            if largest > FAR * its.size:
                return (
                    f"{name} = {largest:g} {its.unit} is more than {FAR:g} times the usual size "
                    f"{its.size:g}; the simulation diverged, or the size in the case file is wrong"
                )
        series = [name for name in given if raw[name].ndim]
        if not series:
            return None
        times = raw.get(TIME)
        if times is None or times.ndim != 1 or len(times) < 2 or not np.all(np.diff(times) > 0.0):
            return f"the program must give increasing times {TIME!r} [s] for its series"
        for name in series:
            if raw[name].shape != times.shape:
                return f"{name} has the shape {raw[name].shape}, its times {times.shape}"
        return None


@dataclass(frozen=True, slots=True)
class FunctionRun:
    """A Python function under fixed conditions. A `Level`."""

    name: str
    function: tuple[str, str]  # file and name
    parameters: tuple[str, ...]
    conditions: Conditions
    time_limit_s: float = 3600.0

    def work(self, x: Array) -> float:
        """Work of a run."""
        return 1.0

    def evaluate(self, x: Array, *, seed: int) -> Outcome:
        """Call the function once; an exception, or what is no number, is a crash."""
        began = process_time()
        status: Status = "finished"
        why: str | None = None
        raw: dict[str, AnyArray] = {}
        with captured() as printed:
            try:
                values = dict(zip(self.parameters, map(float, x), strict=True))
                with _limited(self.time_limit_s):
                    given = _loaded(*self.function)(values, dict(self.conditions), seed)
                raw = _raw(given)
            except _FlawedAnswer as error:
                status, why = "crashed", f"{error}{printed()}"
            except _LateError:
                status = "timed_out"
                why = f"not ready within the time limit of {self.time_limit_s:g} s{printed()}"
            except BaseException as error:
                if from_terminal(error):
                    raise
                status, why = "crashed", f"{explained(error)}{printed()}"
        cpu_s = process_time() - began
        return Outcome(frozen(x), self.name, seed, status, why, raw, 1.0, cpu_s)


class _LateError(BaseException):
    """The time limit is over. Not an `Exception`: these the user's program may catch."""


@contextmanager
def _limited(seconds: float) -> Iterator[None]:
    """Interrupt what runs within at the time limit; only a main thread can be interrupted."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def interrupt(*_: object) -> None:
        raise _LateError

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, seconds, AGAIN)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


class _FlawedAnswer(Exception):
    """What a function returned cannot be used."""


def _raw(given: Any) -> dict[str, AnyArray]:
    """What a function returned, as arrays.

    Raises:
        _FlawedAnswer: if it is no dictionary of finite numbers.
    """
    if not isinstance(given, Mapping):
        what = "nothing" if given is None else shown(given)
        raise _FlawedAnswer(
            f'the function returns {what}; return a dictionary, {{"time": times, channel: values}}'
        )
    raw = {str(name): _numbers(name, value) for name, value in given.items()}
    if (why := why_not_finite(raw)) is not None:
        raise _FlawedAnswer(why)
    return raw


def _numbers(name: Any, value: Any) -> AnyArray:
    if np.ma.is_masked(value):
        raise _FlawedAnswer(f"{name} has masked values; a run must give a value at every time")
    try:
        array = np.asarray(value)
    except ValueError as error:  # lists of unequal lengths
        raise _FlawedAnswer(f"{name} is no array of numbers: {error}") from error
    if array.dtype.kind not in "iuf":
        raise _FlawedAnswer(f"{name} = {shown(value)} is neither a number nor an array of numbers")
    return frozen(array)


def _loaded(file: str, name: str) -> Any:
    """The function of that name in a Python file.

    Raises:
        ConfigError: if there is none.
    """
    function = getattr(_module(file)[0], name, None)
    if not callable(function):
        raise ConfigError(f"rig.function: {file} has no function {name!r}; write FILE.py:NAME")
    return function


@lru_cache
def _module(file: str) -> tuple[ModuleType, tuple[str, ...]]:
    """A Python file as a module, and the files that were loaded from its folder with it.

    Raises:
        ConfigError: if there is none.
    """
    path = Path(file)
    if not path.is_file():
        raise ConfigError(f"rig.function: {file} is no file; write FILE.py:NAME")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise ConfigError(f"rig.function: {file} is no Python file; write FILE.py:NAME")
    module = importlib.util.module_from_spec(spec)
    if (folder := str(path.parent.absolute())) not in sys.path:
        sys.path.insert(0, folder)  # so that the file can import its neighbours
    before = set(sys.modules)
    with captured() as printed:
        try:
            spec.loader.exec_module(module)
        except BaseException as error:  # SystemExit too: a script without a main guard ends itself
            if from_terminal(error):
                raise
            why = f"{explained(error)}{printed()}"
            raise ConfigError(f"rig.function: {file} cannot be loaded: {why}") from error
    new = {getattr(sys.modules[name], "__file__", None) for name in set(sys.modules) - before}
    return module, (file, *sorted(its for its in new if its and _is_own(its, folder)))


def _is_own(file: str, folder: str) -> bool:
    """Whether a file lies in a folder and is of no library that is installed there."""
    return file.startswith(folder + os.sep) and "site-packages" not in file
