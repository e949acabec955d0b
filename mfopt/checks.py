"""Checks of single arguments: what is wrong is named with its value, the limit and the remedy."""

import math
import numbers
import operator
from typing import Any

import numpy as np

from mfopt import names
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


def number(name: str, value: Any, lowest: float = -math.inf, highest: float = math.inf) -> float:
    """`value` as a finite number from `lowest` to `highest`.

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
    if result < lowest:
        raise ConfigError(f"{name} = {result:g} must be at least {lowest:g}; raise it")
    if result > highest:
        raise ConfigError(f"{name} = {result:g} must be at most {highest:g}; lower it")
    return result


def name_of(what: str, value: Any) -> str:
    """`value` as a name that every screen and report can show.

    Raises:
        ConfigError: if it is none.
    """
    if not isinstance(value, str):
        raise ConfigError(f"the name of {what} = {shown(value)} must be a text")
    try:
        return names.shown(value)
    except ValueError as error:
        raise ConfigError(f"the name of {what}: {error}") from None


def shown(value: Any) -> str:
    """What a message shows of a value: at most about 60 characters."""
    try:
        words = " ".join(repr(value).split())
    except Exception:  # the value is the user's, and so is its `__repr__`
        words = f"a {type(value).__name__}"
    return words if len(words) <= 60 else words[:57] + "..."
