"""What was tried, and what became of it."""

import traceback
from collections.abc import Sequence
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Trial:
    """One injected fault."""

    kind: str
    case: str  # what was done, in words
    loss: str | None  # what went wrong; None if all held


def table(trials: Sequence[Trial]) -> str:
    """A line per kind: tried, survived, lost."""
    lines = [f"{'kind':<24}{'tried':>8}{'survived':>10}{'lost':>6}"]
    for kind in dict.fromkeys(t.kind for t in trials):
        own = [t for t in trials if t.kind == kind]
        lost = sum(t.loss is not None for t in own)
        lines.append(f"{kind:<24}{len(own):>8}{len(own) - lost:>10}{lost:>6}")
    return "\n".join(lines)


def losses(trials: Sequence[Trial]) -> list[str]:
    """A line for each trial that was lost."""
    return [f"{t.kind}: {t.case}: {t.loss}" for t in trials if t.loss is not None]


def unforeseen(error: BaseException) -> str:
    """An exception that came through, and the last places that it came from."""
    return "traceback: " + "".join(traceback.format_exception(error, limit=-2, chain=False))
