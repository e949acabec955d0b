"""Recordings that last far longer or shorter than the simulation."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from calibration.durations import unlike_durations
from calibration.recordings.records import Recording, Repeat, Series
from calibration.runs import check_times
from mfopt.commands.app import app
from mfopt.errors import ConfigError
from mfopt.records.evaluation import Candidate, Evaluation
from mfopt.records.outcome import Outcome
from mfopt.records.rig import TIME

BALLS = Path(__file__).resolve().parents[2] / "examples" / "calibration" / "balls"


def recording(last: float, name: str = "drum") -> Recording:
    """Of the angle, until `last` [s]."""
    times = np.linspace(0.0, last, 20)
    series = Series("angle", times, np.sin(times), 0.0, np.zeros(20, bool))
    return Recording(name, {}, (Repeat("a.csv", {"angle": series}),))


def run(last: float, level: str = "drum") -> Evaluation:
    """A run until `last` [s]."""
    times, x = np.linspace(0.0, last, 81), np.zeros(1)
    outcome = Outcome(x, level, 1, "finished", None, {TIME: times, "angle": np.sin(times)})
    return Evaluation(Candidate(0, x, level, 1, 0, "design"), outcome, 0.0)


@pytest.mark.parametrize(
    ("recorded", "said"),
    [
        (
            0.002,
            r"its angle lasts until 0\.002 s, and the simulation until 2 s: .* factor of 1000 ",
        ),
        (0.02, "a factor of 100 apart"),
        (200.0, "a factor of 100 apart"),
        (7200.0, r"lasts until 7200 s, .* correct the unit of the time column, or the cond"),
    ],
)
def test_a_factor_of_a_hundred_is_refused(recorded: float, said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        check_times(recording(recorded), [run(2.0)])


@pytest.mark.parametrize("recorded", [0.021, 0.5, 2.0, 190.0])
def test_what_may_be_meant_is_not_refused(recorded: float) -> None:
    check_times(recording(recorded), [run(2.0)])


def test_a_recording_that_ends_where_the_experiment_starts_has_no_time_in_common() -> None:
    times = np.linspace(-2.0, 0.0, 20)
    series = Series("angle", times, np.sin(times), 0.0, np.zeros(20, bool))
    early = Recording("drum", {}, (Repeat("a.csv", {"angle": series}),))
    with pytest.raises(ConfigError, match="its angle lies from 0 s to 0 s"):
        check_times(early, [run(2.0)])


def test_one_run_that_ends_at_once_refuses_no_recording() -> None:
    check_times(recording(2.0), [run(0.01), run(1.9)])


def test_a_factor_of_ten_is_a_note() -> None:
    recordings = [recording(0.15), recording(0.3, "long"), recording(30.0, "other")]
    made = [run(2.0), run(2.2), run(2.0, "long"), run(2.0, "other"), run(9.0, "none")]
    short, long = unlike_durations(recordings, made)
    assert short.startswith("drum: its angle lasts until 0.15 s, and the simulation until 2 to 2.2")
    assert "check the unit of the time column" in short
    assert long.startswith("other: its angle lasts until 30 s, and the simulation until 2 s")


def test_runs_without_series_say_nothing_of_durations() -> None:
    its = run(2.0)
    number = replace(its, outcome=replace(its.outcome, raw={"angle": np.array(0.3)}))
    assert unlike_durations([recording(0.01)], [number]) == []


@pytest.mark.parametrize(
    "command", [["check", "--dry-run"], ["calibrate", "--method", "lbfgsb"], ["calibrate"]]
)
def test_times_in_a_wrong_unit_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: list[str]
) -> None:
    for file in BALLS.iterdir():
        if file.is_file():
            (tmp_path / file.name).write_text(file.read_text().replace("time [s]", "time [ms]"))
    monkeypatch.chdir(tmp_path)
    options = ["--workers", "1"] if command[0] == "calibrate" else []
    result = CliRunner().invoke(app, [*command, "case.toml", *options])
    assert result.exit_code == 2
    assert "its height lasts until 0.0012 s, and the simulation until" in result.output
