"""Checks of single arguments: what is wrong is named with its value, the limit and the remedy."""

import math
import numbers
import operator
from typing import Any

import numpy as np

from mfopt.errors import ConfigError


def whole(name: str, value: Any, lowest: int, highest: int) -> int:
    """`value` as a whole number from `lowest` to `highest`.

    Raises:
        ConfigError: if it is none; numbers with a decimal point and booleans are none.
    """
    try:
        if isinstance(value, bool | np.bool_):
            raise TypeError
        number = operator.index(value)
    except TypeError:
        raise ConfigError(
            f"{name} = {shown(value)} must be a whole number, such as {lowest}"
        ) from None
    if number < lowest:
        raise ConfigError(f"{name} = {number} must be at least {lowest}; raise it")
    if number > highest:
        raise ConfigError(f"{name} = {number} must be at most {highest}; lower it")
    return number


def number(name: str, value: Any) -> float:
    """`value` as a finite number.

    Raises:
        ConfigError: if it is none; texts and booleans are none.
    """
    if isinstance(value, bool | np.bool_) or not isinstance(value, numbers.Real):
        raise ConfigError(f"{name} = {shown(value)} must be a number; texts are not converted")
    try:
        result = float(value)
    except OverflowError:
        result = math.inf
    if not math.isfinite(result):
        raise ConfigError(f"{name} = {result} must be a finite number")
    return result


def positive(name: str, value: Any, highest: float = math.inf) -> float:
    """`value` as a number above 0 and at most `highest`.

    Raises:
        ConfigError: if it is none.
    """
    result = number(name, value)
    if result <= 0.0 or result > highest:
        most = "" if highest == math.inf else f" and at most {highest:g}"
        raise ConfigError(f"{name} = {result} must be above 0{most}")
    return result


def text(name: str, value: Any) -> str:
    """`value` as a text that is not empty.

    Raises:
        ConfigError: if it is none.
    """
    if not isinstance(value, str) or not value:
        raise ConfigError(f"{name} = {shown(value)} must be a text of at least one character")
    return value


def shown(value: Any) -> str:
    """What a message shows of a value: at most about 60 characters."""
    try:
        words = " ".join(repr(value).split())
    except Exception:  # the value is the user's, and so is its `__repr__`
        words = f"a {type(value).__name__}"
    return words if len(words) <= 60 else words[:57] + "..."
