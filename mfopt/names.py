"""Names and units in text that can be shown on every screen and in every report."""

import unicodedata
from collections.abc import Sequence

LONGEST = 100  # characters; more breaks every table
HIDDEN = ("Cc", "Cs", "Zl", "Zp")  # control characters, lone surrogates, breaks of line, paragraph


def shown(name: str) -> str:
    """The name itself, if it can be shown.

    Raises:
        ValueError: if nothing of it is visible, it holds a control character, or it is too long.
    """
    if not any(unicodedata.category(character)[0] not in "CZ" for character in name):
        raise ValueError(f"{name!r} shows nothing; write at least one letter, digit or sign")
    for character in name:
        if unicodedata.category(character) in HIDDEN:
            raise ValueError(
                f"{name!r} holds the control character {character!r}, which no screen can show; "
                "leave it out"
            )
    if len(name) > LONGEST:
        raise ValueError(
            f"{name[:20]!r}... has {len(name)} characters, above the limit of {LONGEST}; shorten it"
        )
    return name


def file_name(name: str) -> str:
    """The name itself, if a file or directory can be called so on every system.

    Raises:
        ValueError: if it cannot be shown, leads elsewhere, is hidden, or is too long.
    """
    shown(name)
    for character in "/\\:":
        if character in name:
            raise ValueError(
                f"{name!r} holds {character!r}, and a directory is called by it; use another sign"
            )
    if name.startswith("."):
        raise ValueError(f"{name!r} begins with a dot, and a directory is called by it; drop it")
    return name


def word(text: str) -> str:
    """The text itself, if a program can be given it as an argument, and a file be called by it.

    Raises:
        ValueError: if it holds a zero byte.
    """
    if "\0" in text:
        raise ValueError(
            f"{text!r} holds a zero byte, which no argument and no path can hold; leave it out"
        )
    return text


def with_unit(value: float | str, unit: str) -> str:
    """A number, or its text, with its unit; a pure number, whose unit is "-", stands alone."""
    text = value if isinstance(value, str) else f"{value:g}"
    return text if unit == "-" else f"{text} {unit}"


def listed(names: Sequence[str], last: str = "and") -> str:
    """Names in a row: a, b and c."""
    return f" {last} ".join(filter(None, [", ".join(names[:-1]), *names[-1:]]))
