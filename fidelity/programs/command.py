"""The user's own simulator as a level: a command that reads JSON and writes JSON.

The command gets on its standard input one object, {"x": {name: value}, "seed": number,
"level": name}, x in the units of the problem. It writes to its standard output one object, as
all of it or as its last line: either {"f": number}, the objective itself, or any names with
numbers or arrays of numbers, from which an objective is computed
(`mfopt.records.outcome.why_not_a_name` says which names). `work`, if among them, is the work done
[sphere-steps or what the user counts in]. Only a JSON number is a number: neither `true` nor
`"0.5"` nor `null`.
"""

import json
import os
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fidelity.programs.process import OUTPUT_LIMIT, Ended, run_logged
from mfopt.arrays import AnyArray, Array, frozen
from mfopt.errors import ConfigError, SimulationError
from mfopt.files.scratch import scratch
from mfopt.records.outcome import Outcome, Status, why_no_work, why_not_a_name
from mfopt.records.rig import TIME

MOST_DIMENSIONS = 32  # of an array, as in HDF5


@dataclass(frozen=True, slots=True)
class CommandLevel:
    """A level that runs `command` once per evaluation. Implements `mfopt.records.level.Level`."""

    name: str
    command: tuple[str, ...]  # program and arguments; a relative path is taken from here
    variables: tuple[str, ...]  # names, in the order of x
    work_per_run: float  # predicted work of one run
    time_limit_s: float
    conditions: Mapping[str, float | str] = field(default_factory=dict)  # of a recording

    def __post_init__(self) -> None:
        if not self.command:
            raise ConfigError(f"level {self.name!r}: command is empty; give the program to run")
        if (why := why_no_work(self.work_per_run)) is not None:
            raise ConfigError(
                f"level {self.name!r}: {why}; give the cost of a run in any unit that all levels "
                "share"
            )
        if not self.time_limit_s > 0.0:
            raise ConfigError(
                f"level {self.name!r}: time_limit_s = {self.time_limit_s:g} s must be positive"
            )

    def check(self) -> None:
        """See that the program exists.

        Raises:
            ConfigError: if it does not.
        """
        if shutil.which(self.command[0]) is None:
            raise ConfigError(
                f"level {self.name!r}: program {self.command[0]!r} is missing or not executable; "
                "install it or give its full path"
            )

    def work(self, x: Array) -> float:
        """Predicted work of a run; the same for every `x`."""
        return self.work_per_run

    def evaluate(self, x: Array, *, seed: int) -> Outcome:
        """Run the command once at `x` (d,). A failed run is returned, not raised."""
        x = frozen(x)
        question: dict[str, Any] = {
            "x": {name: float(v) for name, v in zip(self.variables, x, strict=True)},
            "seed": seed,
            "level": self.name,
        }
        if self.conditions:
            question["conditions"] = dict(self.conditions)
        with scratch() as directory:
            try:
                ended = run_logged(
                    _absolute(self.command),
                    directory=directory,
                    time_limit_s=self.time_limit_s,
                    stdin=json.dumps(question) + "\n",
                )
            except SimulationError as error:
                return self._failed(x, seed, "crashed", str(error), 0.0)
        return self._outcome(x, seed, ended)

    def _outcome(self, x: Array, seed: int, ended: Ended) -> Outcome:
        if ended.timed_out:
            said = f"; last lines of its output:\n{ended.last_lines}" if ended.last_lines else ""
            why = f"not ready within the time limit of {self.time_limit_s:g} s{said}"
            return self._failed(x, seed, "timed_out", why, ended.cpu_s)
        if ended.returncode != 0:
            why = (
                f"{self.command[0]} ended with {ended.returncode}; last lines of its output:\n"
                f"{ended.last_lines}"
            )
            return self._failed(x, seed, "crashed", why, ended.cpu_s)
        try:
            raw = numbers(answer_object(ended.output))
        except ValueError as error:
            cut = f" (of which only the last {OUTPUT_LIMIT >> 20} MB are kept)" * ended.cut
            said = f"; last lines of its errors:\n{ended.last_errors}" if ended.last_errors else ""
            why = f"{self.command[0]}: {error}{cut}{said}"
            return self._failed(x, seed, "crashed", why, ended.cpu_s)
        work = float(raw.pop("work", np.array(self.work_per_run)))
        return Outcome(x, self.name, seed, "finished", None, raw, work, ended.cpu_s)

    def _failed(self, x: Array, seed: int, status: Status, why: str, cpu_s: float) -> Outcome:
        return Outcome(x, self.name, seed, status, why, {}, self.work_per_run, cpu_s)


def answer_object(output: str) -> Mapping[str, Any]:
    """The JSON object that is the whole of `output` or its last line that is not blank.

    Raises:
        ValueError: if neither is one.
    """
    lines = output.strip().splitlines()
    if not lines:
        raise ValueError("its standard output is empty; it must write one JSON object")
    for text in (output, lines[-1]):
        try:
            answer = json.loads(text)
        except (ValueError, RecursionError):
            continue
        if isinstance(answer, dict):
            return answer
    raise ValueError(f"its standard output does not end with a JSON object: {lines[-1][:80]!r}")


def numbers(answer: Mapping[str, Any]) -> dict[str, AnyArray]:
    """The values of an answer as read-only arrays.

    Raises:
        ValueError: if there is none, a name cannot be kept, a value is not a number or array of
            numbers, or not finite, or `work` is not one number that can be work.
    """
    if not answer.keys() - {"work"}:
        raise ValueError('its answer holds no result; write {"f": number} or named numbers')
    raw: dict[str, AnyArray] = {}
    for name, given in answer.items():
        if (why := why_not_a_name(name)) is not None:
            raise ValueError(why)
        if not _is_numeric(given):
            raise ValueError(f"{name} is neither a number nor an array of numbers")
        try:
            raw[name] = frozen(given)
        except (OverflowError, ValueError) as error:
            raise ValueError(f"{name} is neither a number nor an array of numbers") from error
    if (why := why_not_finite(raw)) is not None:
        raise ValueError(why)
    for name in {"f", "work"} & raw.keys():
        if raw[name].shape != ():
            raise ValueError(f"{name} must be one number, not an array {raw[name].shape}")
    if "work" in raw and (why := why_no_work(float(raw["work"]))) is not None:
        raise ValueError(why)
    return raw


def why_not_finite(raw: Mapping[str, AnyArray]) -> str | None:
    """Which value of which array is not finite, the first of them, with its time; or None."""
    for name, values in raw.items():
        bad = np.argwhere(~np.isfinite(values))
        if not len(bad):
            continue
        first = tuple(map(int, bad[0]))
        if not first:
            return f"{name} = {values:g} is no finite number"
        place, times = f"at index {', '.join(map(str, first))}", raw.get(TIME)
        if times is not None and name != TIME and times.shape == values.shape:
            place += f", time {times[first]:.4g} s,"
        return (
            f"{name} = {values[first]:g} {place} is no finite number; {len(bad)} of {values.size} "
            "values are not"
        )
    return None


def _is_numeric(given: Any, depth: int = 0) -> bool:
    """Whether JSON gave a number, or a list of such things no deeper than `MOST_DIMENSIONS`."""
    if isinstance(given, list):
        return depth < MOST_DIMENSIONS and all(_is_numeric(g, depth + 1) for g in given)
    return type(given) in (int, float)  # not bool, which is an int


def _absolute(command: tuple[str, ...]) -> list[str]:
    """The command with paths from here made absolute: it runs in a directory of its own."""
    program = shutil.which(command[0]) or command[0]
    words = (os.path.abspath(word) if os.path.isfile(word) else word for word in command[1:])
    # abspath, not resolve: a virtual environment's Python is a link, and must be called as one.
    return [os.path.abspath(program), *words]
