"""Noise and scatter of made-up repeats come back; a single recording gives honest bounds."""

import numpy as np
import pytest

from calibration.recordings.case import Known
from calibration.recordings.noise import measurement_noise, noise_of_sums
from calibration.recordings.records import Recording, Repeat, Series
from mfopt.arrays import Array
from mfopt.errors import ConfigError

SIGMA = 5e-4  # [m]
UNKNOWN = Known()


def autocorrelated(t: Array, tau: float, rng: np.random.Generator) -> Array:
    """Noise (n,) with sd 1 and correlation exp(-|dt| / tau)."""
    made = rng.standard_normal(t.size)
    for i in range(1, t.size):
        r = np.exp(-(t[i] - t[i - 1]) / tau) if tau else 0.0
        made[i] = r * made[i - 1] + np.sqrt(1.0 - r**2) * made[i]
    return made


def level(t: Array, *, kink: bool) -> Array:
    """A level [m] that falls, smoothly or to a sudden end."""
    return np.maximum(0.1 - 0.08 * t, 0.01) if kink else 0.01 + 0.09 * np.exp(-((t / 0.8) ** 1.5))


def recording(
    repeats: int, seed: int, *, tau: float = 0.02, n: int = 150, kink: bool = False,
    scatter: float = 1e-3, sigma: float = SIGMA, late: float = 0.0,
) -> Recording:  # fmt: skip
    """Repeats on times of their own, with slow scatter and fast noise; all but one start late."""
    rng = np.random.default_rng(seed)
    made = []
    for i in range(repeats):
        t = np.linspace(0.0, 1.5, n + 7 * i) + 1e-3 * rng.uniform(size=n + 7 * i)
        slow = sum(
            rng.normal(0.0, scatter / (k + 1)) * np.cos(np.pi * k * t / 1.5) for k in range(4)
        )
        values = level(t, kink=kink) + slow + sigma * autocorrelated(t, tau, rng)
        series = Series("level", t + late * (i > 0), values, 0.0, np.zeros(t.size, bool))
        made.append(Repeat(f"{i}", {"level": series}, start_sd_s=np.inf if late else 0.0))
    return Recording("run", {}, tuple(made))


@pytest.mark.parametrize("tau", [0.0, 0.02, 0.05])
@pytest.mark.parametrize("kink", [False, True])
@pytest.mark.parametrize("repeats", [2, 4])
def test_noise_comes_back_from_repeats(tau: float, kink: bool, repeats: int) -> None:
    found = [
        measurement_noise([recording(repeats, seed, tau=tau, kink=kink)], "level", UNKNOWN)
        for seed in range(6)
    ]
    assert np.mean([n.sigma for n in found]) == pytest.approx(SIGMA, rel=0.15)
    assert np.mean([n.autocorrelation_time for n in found]) == pytest.approx(tau, rel=0.5, abs=5e-3)
    held = [n.sigma_range[0] <= SIGMA <= n.sigma_range[1] for n in found]
    assert sum(held) >= 4  # a 90 % interval misses 3 of 6 once in 60 times
    assert {n.found for n in found} == {f"from {repeats} repeats"}


@pytest.mark.parametrize("repeats", [1, 3])
def test_independent_noise_at_uneven_times_lies_in_its_interval(repeats: int) -> None:
    held = 0
    for seed in range(8):
        rng, made = np.random.default_rng(seed), []
        for i in range(repeats):
            t = np.sort(rng.uniform(0.0, 1.5, 60))
            values = level(t, kink=False) + SIGMA * rng.standard_normal(t.size)
            series = Series("level", t, values, 0.0, np.zeros(t.size, bool))
            made.append(Repeat(f"{i}", {"level": series}))
        found = measurement_noise([Recording("run", {}, tuple(made))], "level", UNKNOWN)
        held += found.sigma_range[0] <= SIGMA <= found.sigma_range[1]
    assert held >= 6  # a 90 % interval misses 3 of 8 once in 26 times


def test_recordings_are_pooled() -> None:
    all_of_it = [recording(2, seed) for seed in range(6)]
    one = measurement_noise(all_of_it[:1], "level", UNKNOWN)
    pooled = measurement_noise(all_of_it, "level", UNKNOWN)
    assert pooled.found == "from 12 repeats"
    assert np.ptp(pooled.sigma_range) < 0.6 * np.ptp(one.sigma_range)
    assert pooled.sigma == pytest.approx(SIGMA, rel=0.1)


def test_noise_does_not_depend_on_scatter_or_start() -> None:
    quiet = measurement_noise([recording(3, 1, scatter=0.0)], "level", UNKNOWN).sigma
    for seed in range(3):
        loud = recording(3, seed, scatter=4e-3)
        late = recording(3, seed, scatter=0.0, late=0.3)
        assert measurement_noise([loud], "level", UNKNOWN).sigma == pytest.approx(quiet, rel=0.3)
        assert measurement_noise([late], "level", UNKNOWN).sigma == pytest.approx(quiet, rel=0.3)


@pytest.mark.parametrize("tau", [0.0, 0.02])
@pytest.mark.parametrize("kink", [False, True])
def test_one_recording_gives_bounds(tau: float, kink: bool) -> None:
    for seed in range(6):
        its = recording(1, seed, tau=tau, kink=kink)
        noise = measurement_noise([its], "level", UNKNOWN)
        assert noise.found == "bounded from one recording"
        assert noise.sigma_range[0] <= noise.sigma <= noise.sigma_range[1]
        assert noise.sigma_range[0] <= 1.1 * SIGMA
        assert noise.sigma_range[1] >= 0.95 * SIGMA


def test_noise_scales_with_the_unit() -> None:
    its = recording(3, 2)
    thousand = Recording("mm", {}, tuple(
        Repeat(r.file, {"level": Series("level", s.times, 1e3 * s.values, 0.0, s.clipped)})
        for r in its.repeats for s in r.series.values()
    ))  # fmt: skip
    metres = measurement_noise([its], "level", UNKNOWN)
    millimetres = measurement_noise([thousand], "level", UNKNOWN)
    assert millimetres.sigma == pytest.approx(1e3 * metres.sigma, rel=1e-3)
    assert millimetres.autocorrelation_time == pytest.approx(metres.autocorrelation_time, rel=0.01)


def test_rest_without_noise_does_not_hide_the_noise() -> None:
    rng = np.random.default_rng(0)
    t = np.linspace(0.0, 3.0, 300)
    made = []
    for i in range(3):
        share = np.clip(t / 1.5 + 0.004 * rng.standard_normal(t.size), 0.0, 1.0)
        share[t > 1.52] = 1.0
        series = Series("share", t, share, 0.0, np.zeros(t.size, bool))
        made.append(Repeat(f"{i}", {"share": series}))
    found = measurement_noise([Recording("run", {}, tuple(made))], "share", UNKNOWN)
    assert found.sigma == pytest.approx(0.004, rel=0.15)


def test_noise_is_at_least_that_of_rounding() -> None:
    t = np.linspace(0.0, 1.0, 50)
    steps = Series("level", t, np.round(0.1 - 0.1 * t, 2), 0.01, np.zeros(50, bool))
    found = measurement_noise(
        [Recording("run", {}, (Repeat("a", {"level": steps}),))], "level", UNKNOWN
    )
    assert found.sigma >= 0.01 / np.sqrt(12.0)


def test_stated_noise_is_taken() -> None:
    its = recording(1, 0)
    noise = measurement_noise([its], "level", Known(noise=1e-3))
    assert (noise.sigma, noise.sigma_range, noise.found) == (1e-3, (1e-3, 1e-3), "stated")


def test_repeats_that_show_more_noise_than_stated_count() -> None:
    repeats = tuple(recording(1, seed).repeats[0] for seed in range(3))
    its = [Recording("run", {}, repeats)]
    found = measurement_noise(its, "level", UNKNOWN)
    low, high = found.sigma_range
    less = measurement_noise(its, "level", Known(noise=0.5 * low))
    assert (less.sigma, less.sigma_range) == (found.sigma, found.sigma_range)
    assert less.found == f"from 3 repeats, more than the {0.5 * low:g} stated"
    for stated in (found.sigma, 2.0 * high):
        assert measurement_noise(its, "level", Known(noise=stated)).found == "stated"


def test_too_few_samples_ask_for_a_stated_noise() -> None:
    short = Series("level", np.arange(5.0), np.arange(5.0), 0.0, np.zeros(5, bool))
    its = [Recording("run", {}, (Repeat("a", {"level": short}),))]
    with pytest.raises(ConfigError, match=r"state noise in \[measurement.level\]"):
        measurement_noise(its, "level", UNKNOWN)
    assert measurement_noise(its, "level", Known(noise=0.1)).sigma == 0.1


def test_covariance_is_that_of_the_noise() -> None:
    its = recording(4, 3)
    noise = measurement_noise([its], "level", UNKNOWN)
    times = np.array([0.0, 0.02, 10.0])
    covariance = noise_of_sums(noise, times, np.eye(3))
    assert np.diag(covariance) == pytest.approx(noise.sigma**2)
    decay = np.exp(-0.02 / noise.autocorrelation_time)
    assert covariance[0, 1] == pytest.approx(noise.sigma**2 * decay)
    assert covariance[0, 2] == pytest.approx(0.0, abs=1e-12)
    weights = np.array([[0.5, 0.5, 0.0], [0.0, 1.0, -1.0]])
    assert noise_of_sums(noise, times, weights) == pytest.approx(weights @ covariance @ weights.T)
