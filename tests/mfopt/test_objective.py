import math

import numpy as np
import pytest

from mfopt.errors import ConfigError
from mfopt.objective import dispersion, filling_time, objective_named, returned, value
from mfopt.outcome import Outcome


def raw(times: list[float], cup: int = 0, hopper: int = 0) -> dict[str, np.ndarray]:
    return {
        "passage_times": np.array(times),
        "left_in_cup": np.asarray(cup),
        "left_in_hopper": np.asarray(hopper),
        "duration": np.asarray(1.2),
    }


def test_dispersion_leaves_the_last_twenty_grains_out() -> None:
    # 0, 1, 2, 3 s have the standard deviation sqrt(5)/2; twenty stragglers must not matter.
    times = [0.0, 1.0, 2.0, 3.0]
    for straggler in (10.0, 1000.0):
        terms = dispersion(raw([*times, *[straggler] * 20]))
        assert terms["dispersion"] == pytest.approx(math.sqrt(5.0) / 2.0, rel=1e-14)


def test_grains_left_cost_what_the_paper_says() -> None:
    terms = filling_time(raw([0.1, 0.2, 0.5], cup=7, hopper=3))
    assert terms == pytest.approx(
        {"filling time": 0.4, "left in cup": 0.35, "left in hopper": 1.5}, rel=1e-14
    )


def test_with_too_few_grains_the_duration_stands_in() -> None:
    assert dispersion(raw([0.1] * 22))["dispersion"] == 1.2
    assert filling_time(raw([0.1, 0.2]))["filling time"] == 1.2


def test_dispersion_is_invariant_to_a_shift_of_the_clock() -> None:
    times = np.random.default_rng(1).uniform(0.3, 0.8, 200)
    a, b = (dispersion(raw(list(times + shift)))["dispersion"] for shift in (0.0, 5.0))
    assert a == pytest.approx(b, rel=1e-12)


def test_failed_run_and_nan_are_infinitely_bad() -> None:
    x = np.zeros(1)
    assert value(returned, Outcome(x, "l", 1, "crashed", "why")) == math.inf
    nan = Outcome(x, "l", 1, "finished", raw={"f": np.asarray(math.nan)})
    assert value(returned, nan) == math.inf


def test_unknown_objective_names_the_known() -> None:
    with pytest.raises(ConfigError, match="filling_time"):
        objective_named("fill")
