"""Forecasts of the time to go, for runs that take a known time."""

import math

import pytest

from mfopt.commands.forecast import Forecast, time_to_go

WORK = {"reduced": 0.001, "coarse": 1.0, "fine": 10.0}


class Clock:
    """A clock that is set by hand."""

    now = 0.0

    def __call__(self) -> float:
        return self.now


def forecast(**given: object) -> Forecast:
    return Forecast(WORK, full_run=10.0, **({"workers": 1} | given))  # type: ignore[arg-type]


def test_nothing_is_forecast_before_a_run_that_tells() -> None:
    its = forecast()
    assert its.seconds({"fine": 100.0}) is None
    its.learn("reduced", 0.5)  # most of which was loading
    assert its.seconds({"fine": 100.0}) is None
    assert its.seconds({"fine": 0.0}) == 0.0


def test_a_coarse_run_tells_how_long_the_fine_ones_take() -> None:
    its = forecast()
    its.learn("reduced", 0.5)
    its.learn("coarse", 2.0)
    assert its.seconds({"fine": 100.0}) == pytest.approx(200.0)


def test_runs_of_a_level_itself_tell_more_than_others_and_than_what_was_known() -> None:
    its = forecast(seconds_per_work={"fine": 5.0})
    its.learn("coarse", 2.0)
    assert its.seconds({"fine": 100.0}) == pytest.approx(500.0)
    its.learn("fine", 30.0)
    assert its.seconds({"fine": 100.0, "coarse": 10.0}) == pytest.approx(300.0 + 20.0)


def test_workers_share_the_work_and_their_pauses_count() -> None:
    clock = Clock()
    its = forecast(workers=2, clock=clock)
    its.learn("coarse", 2.0)
    assert its.seconds({"fine": 100.0}) == pytest.approx(100.0)
    clock.now = 10.0  # 16 of the 20 seconds of two workers are spent on runs
    for _ in range(8):
        its.learn("coarse", 2.0)
    assert its.seconds({"fine": 100.0}) == pytest.approx(100.0 / 0.8)


def test_a_steady_run_is_forecast_from_its_first_tenth_within_a_tenth() -> None:
    clock = Clock()
    its, left = forecast(workers=2, clock=clock), 400.0
    for n in range(40):
        clock.now += 1.1  # a run of 2 s ends every 1.1 s on two workers
        its.learn("coarse", 2.0)
        left -= 10.0
        if n >= 4:
            assert its.seconds({"fine": left}) == pytest.approx(1.1 * left, rel=0.1)


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(None, ""), (math.inf, ""), (math.nan, ""), (20.0, "under 1 min to go"),
     (480.0, "about 8 min to go"), (7200.0, "about 2 h to go"), (1e9, "about 2.78e+05 h to go")],
)  # fmt: skip
def test_times_in_words(seconds: float | None, words: str) -> None:
    assert time_to_go(seconds) == words
