"""What errors of camera and sensor do to a series has a closed form.

Scores hold an effect but for what lies beyond the slow waves: 0.001 is a tenth of the scatter.
"""

import numpy as np
import pytest
from toy_diagnosis import TIMES, joint_of, recorded

from calibration.diagnosis.joint import Hypothesis
from calibration.diagnosis.where import in_points
from surrogates.series import SeriesEmulator

BEYOND = 1e-3


def changed(learned: list[SeriesEmulator], name: str, strength: float) -> tuple[np.ndarray, ...]:  # type: ignore[type-arg]
    """The series of the first recording without and with an effect, and its size."""
    joint, suspects, measuring = joint_of(recorded((0.4, 0.6), {}, 1), learned)
    (suspect,) = (s for s in suspects if s.name == name)
    which = Hypothesis((suspect,))
    u = (strength + 1.0) / 2.0 if suspect.signed else strength
    scores = (
        joint.means(which, np.array([[0.4, 0.6, u]])),
        joint.means(Hypothesis(), np.array([[0.4, 0.6]])),
    )
    group = joint.likelihood.groups[0]
    k = len(group.scores)
    with_it, without = (group.emulator.mean + in_points(group, s[0, :k]) for s in scores)
    return without, with_it, np.array(measuring[suspect.number].size(strength))


def test_a_slow_clock_compresses_time(learned: list[SeriesEmulator]) -> None:
    without, with_it, size = changed(learned, "clock_rate", 0.5)
    early = slice(0, 18)  # what comes later lies beyond the end of the run
    wanted = np.interp(TIMES[early] * (1.0 + size), TIMES, without[:24])
    assert with_it[early] == pytest.approx(wanted, abs=2e-3)


def test_a_late_start_shifts_time(learned: list[SeriesEmulator]) -> None:
    without, with_it, size = changed(learned, "clock_offset", -0.5)
    late = slice(6, 24)
    wanted = np.interp(TIMES[late] + size, TIMES, without[:24])
    assert with_it[late] == pytest.approx(wanted, abs=2e-3)


def test_a_scale_acts_on_lengths_only(learned: list[SeriesEmulator]) -> None:
    without, with_it, size = changed(learned, "length_scale", 0.75)
    assert with_it[:24] == pytest.approx((1.0 + size) * without[:24], abs=BEYOND)
    assert with_it[24:] == pytest.approx(without[24:], abs=BEYOND)


def test_a_bias_acts_on_its_channel_only(learned: list[SeriesEmulator]) -> None:
    without, with_it, size = changed(learned, "sensor_bias.share", 1.0)
    assert with_it[:24] == pytest.approx(without[:24], abs=BEYOND)
    added = with_it[24:] - without[24:]
    wanted = float(size) * np.ptp(learned[0].mean[24:])
    assert added == pytest.approx(np.full(24, wanted), abs=BEYOND)


def test_smoothing_leaves_a_straight_line_alone_and_lowers_a_bend(
    learned: list[SeriesEmulator],
) -> None:
    without, with_it, _ = changed(learned, "smoothing", 1.0)
    middle = slice(6, 18)
    assert with_it[:24][middle] == pytest.approx(without[:24][middle], abs=3e-3)
    # The mean of t^2 around a point is t^2 + width^2.
    assert np.all(with_it[24:][middle] >= without[24:][middle] - BEYOND)
