"""What differs between two descriptions of a run, named for its reader."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

MOST_NAMED = 5
NOTHING = "nothing"


@dataclass(frozen=True, slots=True)
class Difference:
    """One entry that differs; `place` names it from the outside in."""

    place: tuple[str, ...]
    old: Any
    new: Any

    def __str__(self) -> str:
        return f"{' '.join(self.place)} {_shown(self.old)} (now {_shown(self.new)})"


def differences(old: Any, new: Any, place: tuple[str, ...] = ()) -> Iterator[Difference]:
    """Entries that differ between two values of what JSON can hold.

    Entries of a list are called by their `name` where they have one, else by their number.
    """
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        for key in dict.fromkeys((*old, *new)):
            yield from differences(old.get(key), new.get(key), (*place, str(key)))
    elif _is_list(old) and _is_list(new):
        for number, (a, b) in enumerate(zip_longest(old, new), start=1):
            yield from differences(a, b, (*place, _called(a) or _called(b) or str(number)))
    elif old != new:
        yield Difference(place, old, new)


def named(found: Sequence[Difference]) -> str:
    """The differences in words, the first few of many."""
    more = len(found) - MOST_NAMED
    shown = ", ".join(map(str, found[:MOST_NAMED]))
    return shown if more <= 0 else f"{shown}, and {more} more"


def _is_list(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str)


def _called(value: Any) -> str | None:
    return str(value["name"]) if isinstance(value, Mapping) and "name" in value else None


def _shown(value: Any) -> str:
    return NOTHING if value is None else str(value)
