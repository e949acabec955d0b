import re
import signal
import threading
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from fidelity.programs.function import FunctionLevel
from mfopt.errors import ConfigError

X = np.array([0.5])


def evaluated(value: Any) -> tuple[str, str]:
    outcome = FunctionLevel("f", lambda x, seed: value).evaluate(X, seed=1)
    return outcome.status, outcome.why or ""


@pytest.mark.parametrize(
    "value",
    [
        0.5, np.float32(0.5), np.float16(0.5), np.longdouble(0.5), np.array(0.5), np.array([0.5]),
        np.array([[0.5]], dtype=np.float32), [0.5], Fraction(1, 2), Decimal("0.5"),
    ],
)  # fmt: skip
def test_real_numbers_of_every_type_are_taken(value: Any) -> None:
    outcome = FunctionLevel("f", lambda x, seed: value).evaluate(X, seed=1)
    assert outcome.status == "finished"
    assert outcome.raw["f"].item() == 0.5


def test_whole_numbers_are_taken() -> None:
    assert [evaluated(v)[0] for v in (2, np.int64(2), np.uint8(2), np.array([2]))] == [
        "finished"
    ] * 4


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (True, "returned True; it must return one real number"),
        (np.bool_(True), "one real number"),
        ("0.5", "returned '0.5'"),
        (0.5 + 0j, "one real number"),
        (None, "returned None"),
        (np.zeros(2), r"an array of shape \(2,\)"),
        (np.zeros(0), r"an array of shape \(0,\)"),
        ([True], "one real number"),
        (float("nan"), "returned nan"),
        (np.inf, "returned inf"),
        (10**400, "too large"),
        ({"f": 0.5}, "one real number"),
    ],
)
def test_what_is_no_number_is_a_crashed_run_that_says_why(value: Any, words: str) -> None:
    status, why = evaluated(value)
    assert status == "crashed"
    assert re.search(words, why), why


class Mute(Exception):
    def __str__(self) -> str:
        raise RuntimeError


@pytest.mark.parametrize(
    "error",
    [SystemExit(0), GeneratorExit(), BaseException("own"), MemoryError(), RecursionError(), Mute()],
)
def test_whatever_a_function_raises_is_a_crashed_run(error: BaseException) -> None:
    def raising(x: Any, seed: int) -> float:
        raise error

    outcome = FunctionLevel("f", raising).evaluate(X, seed=1)
    assert outcome.status == "crashed"
    assert outcome.why is not None
    assert outcome.why.startswith(type(error).__name__)
    assert f"line {raising.__code__.co_firstlineno + 1} of test_function_level.py" in outcome.why


def interrupted(x: Any, seed: int) -> float:
    raise KeyboardInterrupt


def test_an_interrupt_of_the_function_s_own_is_a_crashed_run() -> None:
    found = []
    level = FunctionLevel("f", interrupted)
    thread = threading.Thread(target=lambda: found.append(level.evaluate(X, seed=1)))
    thread.start()
    thread.join()
    assert found[0].status == "crashed"
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # as in a worker process
    try:
        assert level.evaluate(X, seed=1).status == "crashed"
    finally:
        signal.signal(signal.SIGINT, before)


def test_an_interrupt_from_the_terminal_still_interrupts() -> None:
    def slow(x: Any, seed: int) -> float:
        signal.raise_signal(signal.SIGINT)
        return 0.0

    with pytest.raises(KeyboardInterrupt):
        FunctionLevel("f", slow).evaluate(X, seed=1)


def test_wrong_levels_are_named() -> None:
    with pytest.raises(ConfigError, match="level 'f' = 3 cannot be called"):
        FunctionLevel("f", 3)  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="work_per_run = 0 must be at least"):
        FunctionLevel("f", lambda x, seed: 0.0, 0.0)
    with pytest.raises(ConfigError, match="name of a level"):
        FunctionLevel("", lambda x, seed: 0.0)


@pytest.mark.parametrize("function", [lambda x: 0.0, lambda x, seed, more: 0.0, lambda: 0.0])
def test_a_function_of_another_number_of_arguments_is_refused_at_once(function: Any) -> None:
    with pytest.raises(
        ConfigError, match=r"'f' cannot be called with x and seed: .*function\(x, s"
    ):
        FunctionLevel("f", function)


def test_further_arguments_may_have_defaults() -> None:
    level = FunctionLevel("f", lambda x, seed, scale=2.0: scale)  # type: ignore[misc]
    assert level.evaluate(X, seed=1).raw["f"] == 2.0
