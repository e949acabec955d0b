"""L-BFGS-B on the tank: it comes near the truth, spends what it may, and says when it cannot."""

import json

import numpy as np
import pytest
from test_calibrate import case_of, evaluate
from toy_rig import Tank

from calibration.least_squares import fit_least_squares, least_squares_summary
from calibration.recordings.noise import measurement_noise
from mfopt.arrays import frozen
from mfopt.errors import ConfigError, SimulationError
from mfopt.records.evaluation import Evaluation
from mfopt.records.outcome import Outcome

CASE = case_of(frozen([0.35, 0.03]), 1)
NOISES = {"level": measurement_noise(CASE.recordings, "level", CASE.measurement.of("level"))}


def test_it_comes_near_the_truth_and_spends_no_more_than_it_may() -> None:
    found = fit_least_squares(CASE, NOISES, lambda c: evaluate(c, CASE), 80)
    assert found.best == pytest.approx([0.35, 0.03], abs=0.02)
    assert 60 <= len(found.evaluations) <= 80
    its = least_squares_summary(found, CASE, Tank.channels)
    assert json.loads(its.as_json)["parameters"]["rate"] == found.best[0]
    assert its.in_words[0] == f"rate = {found.best[0]:.3g}"


def test_two_fits_are_equal() -> None:
    first, second = (
        fit_least_squares(CASE, NOISES, lambda c: evaluate(c, CASE), 40) for _ in range(2)
    )
    assert np.array_equal(first.best, second.best)


def test_too_few_runs_and_failing_runs_are_said() -> None:
    with pytest.raises(ConfigError, match="give at least 15"):
        fit_least_squares(CASE, NOISES, lambda c: evaluate(c, CASE), 14)
    with pytest.raises(SimulationError, match=r"every run failed; .* The reason of all: no"):
        fit_least_squares(
            CASE,
            NOISES,
            lambda its: [
                Evaluation(c, Outcome(c.x, c.level, c.seed, "crashed", "no"), np.inf) for c in its
            ],
            30,
        )
