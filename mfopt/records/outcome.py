"""What one simulation run gave, finished or failed."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

import numpy as np

from mfopt.arrays import AnyArray, Array

Status = Literal["finished", "crashed", "timed_out", "invalid_design"]

LONGEST_NAME = 100  # characters of an array's name
LONGEST_WHY = 10_000  # characters; the rest of a longer one is left out
# A real run takes 1e5 to 1e13 sphere-steps. Beyond these limits sums and quotients of work would
# leave the range of numbers.
SMALLEST_WORK, LARGEST_WORK = 1e-12, 1e18


@dataclass(frozen=True, slots=True, eq=False)
class Outcome:
    """One simulation run: raw results that any objective can be computed from later.

    `raw` maps a name to an array (0-d for a scalar), SI units; a scene says which names.
    """

    x: Array  # (d,) design, physical units
    level: str
    seed: int
    status: Status
    why: str | None = None  # one line, then the last of its log if it crashed; None if finished
    raw: Mapping[str, AnyArray] = field(default_factory=dict)
    work: float = 0.0  # [sphere-steps times the engine's cost factor]
    cpu_s: float = 0.0  # measured; never decides anything

    @property
    def finished(self) -> bool:
        """Whether the run ended as it should."""
        return self.status == "finished"


def checked(outcome: Any, x: Array, level: str, seed: int) -> Outcome:
    """The outcome of a level, fit to be kept; a crashed run that says why if it is not.

    Names are plain, arrays are of numbers, `why` is text that every screen and file can show.
    """
    if not isinstance(outcome, Outcome):
        why = f"the level returned {type(outcome).__name__}, not an Outcome"
        return Outcome(x, level, seed, "crashed", why)
    try:
        raw = {name: np.asarray(values) for name, values in outcome.raw.items()}
        work, cpu_s = float(outcome.work), float(outcome.cpu_s)
        flaw = _flaw(outcome.status, raw, work, cpu_s)
    except (AttributeError, TypeError, ValueError, OverflowError) as error:
        flaw = f"{type(error).__name__}: {error}"
    if flaw is not None:
        why = plain(f"the outcome cannot be kept: {flaw}")
        return Outcome(x, level, seed, "crashed", why)
    said = None if outcome.why is None else plain(str(outcome.why))
    return Outcome(x, level, seed, outcome.status, said, raw, work, cpu_s)


def _flaw(status: str, raw: Mapping[str, AnyArray], work: float, cpu_s: float) -> str | None:
    """Why this cannot be kept, or None."""
    if status not in get_args(Status):
        return f"status {status!r} is not one of {', '.join(get_args(Status))}"
    for name, values in raw.items():
        if (why := why_not_a_name(name)) is not None:
            return why
        if values.dtype.kind not in "biuf":
            return f"{name} holds no numbers"
    if not 0.0 <= cpu_s < math.inf:
        return f"cpu_s = {cpu_s:g} must be a finite number, not below 0"
    return None if work == 0.0 else why_no_work(work)


def plain(text: str) -> str:
    """The text without what a screen or a file could not show, and not too long."""
    shown = text if len(text) <= LONGEST_WHY else f"{text[:LONGEST_WHY]} ..."
    return "".join(map(_shown, shown))


def _shown(c: str) -> str:
    if c.isprintable() or c in "\n\t":
        return c
    return " " if c.isspace() else "\N{REPLACEMENT CHARACTER}"


def why_not_a_name(name: Any) -> str | None:
    """Why this is no name of an array, or None: a store cannot keep every text as a name."""
    if (
        isinstance(name, str)
        and 0 < len(name) <= LONGEST_NAME
        and name.isprintable()
        and name == name.strip()
        and "/" not in name
        and name.strip(".")
    ):
        return None
    return (
        f"the name {plain(repr(name))[:80]} cannot be kept; use 1 to {LONGEST_NAME} letters, "
        "digits or signs, with no slash, no space at an end and not dots alone"
    )


def why_no_work(work: float) -> str | None:
    """Why this cannot be the work of a run, or None."""
    if SMALLEST_WORK <= work <= LARGEST_WORK:
        return None
    if not work > 0.0:
        return f"work = {work:g} must be positive"
    return f"work = {work:g} must be between {SMALLEST_WORK:g} and {LARGEST_WORK:g}"
