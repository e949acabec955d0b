"""Each peer finds the tank's parameters on the runs it may make; errors have one yardstick."""

from collections.abc import Sequence

import pytest
from test_calibrate import case_of, evaluate

from benchmarks.calibration.grainlearning_peer import PYTHON
from benchmarks.calibration.peer_methods import METHODS, with_predictions
from benchmarks.calibration.peers import FIRST_JUDGED, JUDGED, errors, fitted, report
from calibration.recordings.noise import measurement_noise
from calibration.runs import predictions_of_each
from mfopt.arrays import frozen
from mfopt.records.evaluation import Candidate, Evaluation

CASE = case_of(frozen([0.35, 0.03]), 1)
LIGHT = [name for name in METHODS if name != "GrainLearning"]
NOISES = {"level": measurement_noise(CASE.recordings, "level", CASE.measurement.of("level"))}


needs_environment = pytest.mark.skipif(not PYTHON.exists(), reason=f"there is no {PYTHON}")


@pytest.mark.parametrize("method", [*LIGHT, pytest.param("GrainLearning", marks=needs_environment)])
def test_a_method_finds_the_parameters_and_spends_its_budget(method: str) -> None:
    made: list[Candidate] = []

    def run(asked: Sequence[Candidate]) -> list[Evaluation]:
        made.extend(asked)
        return evaluate(asked, CASE)

    line = fitted(method, CASE, NOISES, run, 80)
    assert line["found"] == pytest.approx([0.35, 0.03], abs=0.02)
    assert [its["recording"] for its in line["held_out"]] == ["other"]
    spent = [c for c in made if c.purpose != "predict"]
    assert 60 <= len(spent) <= 80
    assert {c.level for c in spent} == {"full", "half"}
    judged = [c for c in made if c.index >= FIRST_JUDGED]
    assert [c.seed for c in judged] == [FIRST_JUDGED + 1 + i for i in range(JUDGED)]


@pytest.mark.parametrize("runs", [50, 80, 200])
def test_predictions_come_on_top(runs: int) -> None:
    whole = with_predictions(CASE, runs)
    assert whole - predictions_of_each(CASE, whole) * len(CASE.recordings) == runs


def test_errors_have_one_yardstick_and_ratios_are_paired() -> None:
    def line(name: str, method: str, square: float, variance: float) -> dict[str, object]:
        its = {"recording": "r", "channel": "c", "repeats": 1, "runs": 2, "square": square,
               "variance": variance, "measured": 1.0}  # fmt: skip
        return {"budget": 50, "experiment": name, "method": method, "held_out": [its]}

    made = [line("a", "mfopt", 4.0, 1.0), line("a", "surmise", 16.0, 3.0),
            line("b", "mfopt", 9.0, 2.0)]  # fmt: skip
    found = errors(made)  # the variance is 2 for all: 2 (1 + 1/2) + 1 = 4
    assert found == {(50, "a", "mfopt"): 1.0, (50, "a", "surmise"): 2.0, (50, "b", "mfopt"): 1.5}
    told = report(made)
    assert told[2].split() == ["b", "1.50", "-"]
    assert told[3].split()[-2:] == ["1.00", "2.00"]
