from decimal import Decimal
from typing import Any

import numpy as np
import pytest

from mfopt.checks import name_of, number, shown, whole
from mfopt.errors import ConfigError


def test_whole_numbers_of_every_type_pass() -> None:
    for value in (3, np.int64(3), np.uint8(3)):
        assert type(whole("n", value, 1, 5)) is int


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (0, "n = 0 must be at least 1; raise it"),
        (10**400, "must be at most 5; lower it"),
        (2.0, r"n = 2\.0 must be a whole number"),
        (True, "n = True must be a whole number"),
        (np.bool_(True), "whole number"),
        ("3", "n = '3' must be a whole number"),
        (None, "n = None must be a whole number"),
        (float("nan"), "n = nan must be a whole number"),
    ],
)
def test_what_is_no_whole_number_is_named(value: Any, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        whole("n", value, 1, 5)


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (float("nan"), "s = nan must be a finite number"),
        (float("inf"), "s = inf must be a finite number"),
        (10**400, "finite number"),
        (-0.5, r"s = -0\.5 must be at least 0"),
        (2, "s = 2 must be at most 1"),
        ("1", "s = '1' must be a number"),
        (True, "s = True must be a number"),
        (1j, "s = 1j must be a number"),
        (Decimal("0.5"), "must be a number"),
        (np.zeros(2), "must be a number"),
    ],
)
def test_what_is_no_number_is_named(value: Any, words: str) -> None:
    with pytest.raises(ConfigError, match=words):
        number("s", value, 0.0, 1.0)


def test_numbers_of_every_type_pass() -> None:
    for value in (1, 1.0, np.float32(1.0), np.int8(1)):
        assert number("s", value, 0.0, 1.0) == 1.0


@pytest.mark.parametrize("value", [3, "", "\0", "a\nb", "x" * 101, None])
def test_names_that_no_screen_can_show_are_refused(value: Any) -> None:
    with pytest.raises(ConfigError, match="name of a level"):
        name_of("a level", value)


def test_a_value_is_shown_in_few_characters() -> None:
    class Broken:
        def __repr__(self) -> str:
            raise RuntimeError

    assert len(shown(np.zeros(1000))) <= 60
    assert shown(Broken()) == "a Broken"
