"""Text of users made printable: escapes replace characters that fonts or XML do not allow."""

import re
from collections.abc import Mapping
from copy import copy
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar

from mfopt.campaign.store import RunDirectory

T = TypeVar("T")

# Control characters but tab and line feed, lone surrogates, and what Unicode calls no character.
UNPRINTABLE = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\ud800-\udfff\ufdd0-\ufdef\ufffe\uffff]")


def plain(text: str) -> str:
    """The text with each unprintable character as its escape, such as \\x07."""
    return UNPRINTABLE.sub(lambda found: ascii(found[0])[1:-1], text)


def readable(given: T) -> T:
    """A record, mapping or sequence with all text in it plain."""
    made: Any = given
    if isinstance(given, str):
        made = plain(given)
    elif isinstance(given, Mapping):
        made = {readable(key): readable(value) for key, value in given.items()}
    elif isinstance(given, list | tuple):
        made = type(given)(map(readable, given))
    elif is_dataclass(given) and not isinstance(given, type):
        made = replace(given, **{f.name: readable(getattr(given, f.name)) for f in fields(given)})
    return made  # type: ignore[no-any-return]


def readable_run(run: RunDirectory) -> RunDirectory:
    """A run directory whose header, generations, insights and ends are plain text."""
    copied = copy(run)
    copied.header = readable(run.header)
    copied.generations, copied.insights = readable(run.generations), readable(run.insights)
    copied.reference, copied.end = readable(run.reference), readable(run.end)
    return copied
