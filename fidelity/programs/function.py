"""A Python function as a level."""

import inspect
import numbers
import signal
import threading
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np

from mfopt.arrays import AnyArray, Array
from mfopt.checks import name_of, number, shown
from mfopt.errors import ConfigError
from mfopt.records.outcome import LARGEST_WORK, SMALLEST_WORK, Outcome, Status

Simulator = Callable[[Array, int], Any]  # (x (d,), seed) -> objective value
LONGEST = 2000  # characters of an exception's message that are kept


@dataclass(frozen=True, slots=True)
class FunctionLevel:
    """A Python function as a level: `function(x, seed)` returns the number to minimise.

    Raises:
        ConfigError: if the name cannot be shown, the function cannot be called, or the work is no
            number from 1e-12 to 1e18.
    """

    name: str
    function: Simulator
    work_per_run: float = 1.0

    def __post_init__(self) -> None:
        name_of("a level", self.name)
        if not callable(self.function):
            raise ConfigError(
                f"level {self.name!r} = {shown(self.function)} cannot be called; "
                "give a function(x, seed) that returns a number"
            )
        if (why := _refuses_two(self.function)) is not None:
            raise ConfigError(
                f"level {self.name!r} cannot be called with x and seed: {why}; "
                "give a function(x, seed) that returns a number"
            )
        number(f"{self.name!r}: work_per_run", self.work_per_run, SMALLEST_WORK, LARGEST_WORK)

    def work(self, x: Array) -> float:
        """Work of one run, in the user's own unit."""
        return self.work_per_run

    def evaluate(self, x: Array, *, seed: int) -> Outcome:
        """Call the function once; an exception or a value that is no number is a crash.

        A number is a real one, or an array with one. An interrupt from the terminal is passed on.
        """
        began = process_time()
        status: Status = "finished"
        why: str | None = None
        raw: dict[str, AnyArray] = {}
        try:
            raw = {"f": np.asarray(_number(self.function(x, seed)))}
        except BaseException as error:
            if from_terminal(error):
                raise
            status, why = "crashed", explained(error)
        cpu_s = process_time() - began
        return Outcome(x, self.name, seed, status, why, raw, self.work_per_run, cpu_s)


def _refuses_two(function: Simulator) -> str | None:
    """Why a function cannot be called with two values; None if it can, or does not say."""
    try:
        taken = inspect.signature(function)
    except (TypeError, ValueError):  # of functions in C
        return None
    try:
        taken.bind(None, 1)
    except TypeError as error:
        return str(error)
    return None


class _NoNumber(Exception):
    """What a function returned is no number."""


def _number(value: Any) -> float:
    """The number that a function returned.

    Raises:
        _NoNumber: if it is a truth value, a text, complex, not finite, or not one number.
    """
    if isinstance(value, numbers.Real | Decimal) and not isinstance(value, bool):
        f = float(value)
    else:
        array = np.asarray(value)
        if array.dtype.kind not in "iuf" or array.size != 1:
            what = f"an array of shape {array.shape}" if array.ndim else shown(value)
            raise _NoNumber(f"the function returned {what}; it must return one real number")
        f = float(array.item())
    if not np.isfinite(f):
        raise _NoNumber(f"the function returned {f}")
    return f


def explained(error: BaseException) -> str:
    """What went wrong, and in which line of the user's program."""
    if isinstance(error, _NoNumber):
        return str(error)
    try:
        message = str(error)[:LONGEST]
    except Exception:  # the exception is the user's, and so is its `__str__`
        message = "it has no message"
    said = f"{type(error).__name__}: {message}" if message else type(error).__name__
    # The first is that of `evaluate`. A file that is no Python ends in the import of Python itself.
    frames = [
        frame
        for frame in traceback.extract_tb(error.__traceback__)[1:]
        if not frame.filename.startswith("<frozen ")
    ]
    if not frames:
        return said
    return f"{said} (line {frames[-1].lineno} of {Path(frames[-1].filename).name})"


def from_terminal(error: BaseException) -> bool:
    """Whether this is a Ctrl-C: only the main thread of a process that heeds it gets one."""
    return (
        isinstance(error, KeyboardInterrupt)
        and threading.current_thread() is threading.main_thread()
        and signal.getsignal(signal.SIGINT) is not signal.SIG_IGN
    )
