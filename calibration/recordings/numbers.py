"""Numbers in the cells of a recording: decimal point or comma, gaps, and what is no number."""

import math
import re
from collections.abc import Iterable

from mfopt.errors import ConfigError

MINUS = "\N{MINUS SIGN}"  # that some programs write for a hyphen
GAPS = frozenset({"", "nan", "na", "n/a", "#n/a", "null", "none", "-", "--"})

_NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?", re.ASCII)
_INFINITE = re.compile(r"[+-]?(inf|infinity|∞)", re.IGNORECASE)


def is_number(cell: str) -> bool:
    """Whether a cell is a number with decimal point or comma."""
    return _NUMBER.fullmatch(cell.replace(MINUS, "-")) is not None


def number_of(cell: str, where: str) -> float:
    """The number of a cell; nan for a gap.

    Raises:
        ConfigError: if the cell holds text or no finite number.
    """
    text = cell.replace(MINUS, "-")
    if text.lower() in GAPS:
        return math.nan
    value = float(text.replace(",", ".")) if _NUMBER.fullmatch(text) else None
    if _INFINITE.fullmatch(text) or (value is not None and math.isinf(value)):
        raise ConfigError(
            f"{where} = {cell!r} must be a finite number; leave the cell empty where there is no "
            "value"
        )
    if value is None:
        raise ConfigError(
            f"{where} = {cell[:40]!r} is no number; write one such as 12.5, or leave the cell "
            "empty where there is no value"
        )
    return value


def check_one_decimal_sign(cells: Iterable[tuple[int, str]], file: str) -> bool:
    """Whether the numbers of a file have a decimal comma.

    Args:
        cells: line and text of each.
        file: for messages.

    Raises:
        ConfigError: if some have a decimal point and some a decimal comma.
    """
    first: dict[str, tuple[int, str]] = {}
    for line, cell in cells:
        for sign in ".,":
            if sign in cell and sign not in first and is_number(cell):
                first[sign] = (line, cell)
    if len(first) == 2:
        (line, cell), (other_line, other) = sorted(first.values(), reverse=True)
        raise ConfigError(
            f"{file}, line {line}: {cell!r} and {other!r} of line {other_line} have different "
            "decimal signs; use one, and none for thousands"
        )
    return "," in first
