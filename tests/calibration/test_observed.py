"""A recording and a run of the same course give the same row, however coarse its points."""

import numpy as np
import pytest

from calibration.observed import observed
from calibration.recordings.case import Measurement
from calibration.recordings.records import Noise, Recording, Repeat, Series
from mfopt.arrays import Array, frozen
from mfopt.records.rig import TIME

QUIET = {"angle": Noise("angle", 1e-3, 0.0, (1e-3, 1e-3), "stated")}


def swing(times: Array) -> Array:
    """16 swings in 8 s: 2.4 of 40 points to a swing."""
    return np.asarray(np.exp(-0.1 * times) * np.cos(4.0 * np.pi * times))


def recorded(*rates: float) -> Recording:
    repeats = []
    for number, rate in enumerate(rates):
        times = np.arange(0.0, 8.0, 1.0 / rate)
        its = Series("angle", frozen(times), frozen(swing(times)), 0.0, np.zeros(len(times), bool))
        repeats.append(Repeat(f"{number}.csv", {"angle": its}))
    return Recording("swing", {}, tuple(repeats))


@pytest.mark.parametrize("end", [9.0, 6.3])  # [s] of the simulated time
def test_a_run_is_averaged_as_the_recording_is(end: float) -> None:
    seen = observed(recorded(100.0, 77.0), Measurement(), QUIET, end)
    times = np.linspace(0.0, end, 4000)
    assert seen.row({TIME: times, "angle": swing(times)}) == pytest.approx(seen.values, abs=1e-4)


def test_noise_falls_with_the_number_of_samples() -> None:
    few, many = (observed(recorded(rate), Measurement(), QUIET, 9.0) for rate in (50.0, 5000.0))
    ratio = np.diag(few.measured) / np.diag(many.measured)
    assert ratio == pytest.approx(100.0, rel=0.2)
