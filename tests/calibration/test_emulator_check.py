"""The check of the emulators passes right ones and finds those that are wrong on purpose."""

from dataclasses import replace

import numpy as np
import pytest

from calibration.emulator_check import _freedom, check_fresh, check_left_out
from mfopt.arrays import Array, frozen
from surrogates.series import SeriesEmulator, fit_series

TIMES = np.linspace(0.0, 1.0, 20)
CHANCE = 0.005
NOISE = 0.0  # nothing is measured


def runs(z: Array, rng: np.random.Generator) -> Array:
    """A curve that saturates, with slow and faster packing noise."""
    waves = np.sin(np.pi * TIMES * np.arange(1, 9)[:, None]) / np.arange(1, 9)[:, None]
    noise = 0.03 * rng.normal(size=(len(z), 8)) @ waves
    return np.asarray(1.0 - np.exp(-(1.0 + 3.0 * z[:, [0]]) * TIMES) + 0.2 * z[:, [1]] + noise)


def emulator_of(seed: int) -> SeriesEmulator:
    rng = np.random.default_rng(seed)
    z = rng.random((40, 2))
    z = np.vstack([z, z[:8]])
    return fit_series(z, runs(z, rng), [len(TIMES)])


def fresh_runs(seed: int, count: int = 6) -> tuple[Array, Array]:
    """Runs as draws of a posterior are: near each other."""
    rng = np.random.default_rng(seed)
    z = 0.4 + 0.2 * rng.random((count, 2))
    return z, runs(z, rng)


@pytest.fixture(scope="module")
def emulators() -> list[SeriesEmulator]:
    return [emulator_of(seed) for seed in range(8)]


def test_right_emulators_pass(emulators: list[SeriesEmulator]) -> None:
    checks = [
        check
        for seed, emulator in enumerate(emulators)
        for check in (
            check_left_out("a", emulator, CHANCE, NOISE),
            check_fresh("a", emulator, *fresh_runs(100 + seed), CHANCE, NOISE),
        )
    ]
    assert not any(c.too_sure for c in checks)
    assert 0.84 < np.mean([c.held for c in checks]) < 0.96
    assert 0.7 < np.mean([c.squared for c in checks]) < 1.3
    assert all(0.6 < c.error < 2.0 for c in checks)  # hardly more than the scatter of a run


def too_sure(its: SeriesEmulator, factor: float) -> SeriesEmulator:
    """The same means, with all variances `factor` times as large."""
    scores = its.scores
    narrow = replace(
        scores,
        signal=frozen(factor * scores.signal),
        noise=frozen(factor * scores.noise),
        inverse=frozen(scores.inverse / factor),
        weights=frozen(scores.weights / factor),
    )
    return replace(its, scores=narrow, noise=frozen(factor * its.noise))


def test_an_emulator_that_takes_a_third_of_the_variance_is_found(
    emulators: list[SeriesEmulator],
) -> None:
    for seed, emulator in enumerate(emulators):
        wrong = too_sure(emulator, 1.0 / 3.0)
        check = check_left_out("a", wrong, CHANCE, NOISE)
        assert check.too_sure
        assert check.squared == pytest.approx(
            3.0 * check_left_out("a", emulator, CHANCE, NOISE).squared, rel=1e-6
        )
        assert check.held < 0.85
        z, rows = fresh_runs(200 + seed, 20)
        assert check_fresh("a", wrong, z, rows, CHANCE, NOISE).too_sure


def test_a_mean_that_is_off_where_the_posterior_is_shows_in_fresh_runs_only(
    emulators: list[SeriesEmulator],
) -> None:
    for seed, emulator in enumerate(emulators):
        z, rows = fresh_runs(300 + seed)
        moved = rows + 0.15 * TIMES  # the simulator does there what no run of the fit showed
        check = check_fresh("a", emulator, z, moved, CHANCE, NOISE)
        assert check.too_sure
        assert check.held < 0.85
        assert check.error > 1.5
        assert not check_left_out("a", emulator, CHANCE, NOISE).too_sure


def test_errors_of_the_stated_covariance_warn_as_often_as_stated() -> None:
    # Errors drawn from strongly correlated covariances: the law of their mean square is no plain
    # chi-squared, and the degrees of freedom must say so.
    rng = np.random.default_rng(1)
    n, k = 6, 3
    covariance = np.array([0.6 * np.ones((n, n)) + 0.4 * np.eye(n)] * k)
    between = np.array([[1.0, 0.28, 0.0], [0.28, 1.0, 0.0], [0.0, 0.0, 1.0]])
    whole = np.kron(np.eye(k), covariance[0]) + np.kron(between - np.eye(k), np.eye(n))
    draws = rng.multivariate_normal(np.zeros(n * k), whole, 20_000)
    squared = np.mean(draws**2, axis=1)
    freedom = _freedom(covariance, between)
    assert freedom < 0.5 * n * k
    assert np.var(squared) == pytest.approx(2.0 / freedom, rel=0.1)
