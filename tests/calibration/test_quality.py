"""Step between values, limits of the sensor and gaps are found, and only where they are."""

import numpy as np
import pytest

from calibration.recordings.quality import clipped_at, gaps_in, quantum_of, slipped
from mfopt.arrays import Array

T = np.linspace(0.0, 3.0, 301)


def noisy(seed: int = 0, sd: float = 0.3) -> Array:
    """A level [mm] that falls, with measurement noise."""
    return 100.0 - 25.0 * T + sd * np.random.default_rng(seed).standard_normal(T.size)


@pytest.mark.parametrize("step", [5.0, 0.5, 0.1, 0.02, 1.0 / 3.0, 0.3725])
def test_quantum_is_the_step_of_the_sensor(step: float) -> None:
    assert quantum_of(np.round(noisy() / step) * step) == pytest.approx(step, rel=1e-3)


def test_quantum_of_a_coarse_sensor_written_with_few_decimals() -> None:
    # A pixel of 0.3725 mm, written to 0.01 mm: the sensor decides, not the file.
    values = np.round(np.round(noisy() / 0.3725) * 0.3725, 2)
    assert quantum_of(values) == pytest.approx(0.3725, rel=0.05)


def test_fine_values_have_no_quantum() -> None:
    assert quantum_of(noisy()) == 0.0


def test_one_value_has_no_quantum() -> None:
    assert quantum_of(np.full(10, 3.0)) == 0.0


@pytest.mark.parametrize("sd", [0.0, 0.3, 2.0])
@pytest.mark.parametrize("digits", [1, 6])
@pytest.mark.parametrize("limit", [45.0, 80.0])
def test_clipped_at_either_end(sd: float, digits: int, limit: float) -> None:
    values = np.round(noisy(sd=sd), digits)
    above, below = np.minimum(values, limit), np.maximum(values, limit)
    for clipped in (above, below):
        found = clipped_at(clipped, quantum_of(clipped), "m")
        assert np.array_equal(found, clipped == limit)


def test_a_swing_clipped_at_the_top() -> None:
    swing = np.sin(6.0 * T)
    found = clipped_at(np.minimum(swing, 0.8), 0.0, "rad")
    assert np.array_equal(found, swing >= 0.8)


@pytest.mark.parametrize("step", [1e-3, 0.02])
def test_turning_points_of_a_coarse_sensor_are_not_clipped(step: float) -> None:
    swing = np.round(np.sin(6.0 * T) / step) * step
    assert not np.any(clipped_at(swing, step, "rad"))


def test_rest_after_a_slowdown_is_not_clipped() -> None:
    # A balance at rest: the last grains come ever more slowly.
    mass = np.round(150.0 * (1.0 - np.exp(-4.0 * T)), 1)
    assert np.sum(mass == mass.max()) > 10
    assert not np.any(clipped_at(mass, 0.1, "kg"))


def test_empty_and_full_are_no_limits_of_a_sensor() -> None:
    share = np.clip(0.5 * T, 0.0, 1.0)
    assert not np.any(clipped_at(share, 0.0, "-"))
    assert not np.any(clipped_at(1.0 - share, 0.0, "-"))


def test_a_constant_series_is_not_clipped() -> None:
    assert not np.any(clipped_at(np.full(50, 2.0), 0.0, "m"))


def test_noise_alone_is_not_clipped() -> None:
    for seed in range(50):
        values = np.round(np.random.default_rng(seed).standard_normal(200), 1)
        assert not np.any(clipped_at(values, 0.1, "m"))


def test_gaps_are_counted_in_regular_times_only() -> None:
    kept = np.delete(T, [50, 51, 52, 200])
    number, longest, begin = gaps_in(kept)
    assert number == 2
    assert longest == pytest.approx(0.04)
    assert begin == pytest.approx(T[49])
    assert gaps_in(T)[0] == 0
    assert gaps_in(np.cumsum(np.random.default_rng(0).exponential(1.0, 100)))[0] == 0


@pytest.mark.parametrize("factor", [1e3, 1e-3])
def test_a_lost_decimal_sign_shows_beside_its_neighbours(factor: float) -> None:
    values = noisy()
    values[77] *= factor
    assert slipped(values) == 77


def test_honest_values_do_not_slip() -> None:
    assert slipped(noisy()) is None
    assert slipped(np.sin(6.0 * T)) is None  # passes through 0
    assert slipped(np.random.default_rng(1).standard_normal(2000)) is None
