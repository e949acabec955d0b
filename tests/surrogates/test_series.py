"""The emulator of series: it finds the mean, knows its doubt, and tells the scatter of a run."""

import numpy as np
import pytest

from mfopt.arrays import Array
from mfopt.errors import ConfigError
from surrogates.series import SeriesEmulator, fit_series

TIMES = np.linspace(0.0, 1.0, 30)
SCATTER = 0.03


def truth(z: Array) -> Array:
    rate = 1.0 + 3.0 * z[:, [0]]
    return np.hstack([1.0 - np.exp(-rate * TIMES), 0.1 * z[:, [1]] ** 2 * TIMES])


def runs(z: Array, seed: int) -> Array:
    rng = np.random.default_rng(seed)
    slow = SCATTER * rng.normal(size=(len(z), 1)) * np.sin(np.pi * TIMES)
    return truth(z) + np.hstack([slow, 0.1 * slow])


@pytest.fixture(scope="module")
def emulator() -> SeriesEmulator:
    rng = np.random.default_rng(1)
    z = rng.random((50, 2))
    z = np.vstack([z, z[:10]])
    return fit_series(z, runs(z, 2), [30, 30])


def test_the_mean_is_far_closer_than_one_run(emulator: SeriesEmulator) -> None:
    z = 0.05 + 0.9 * np.random.default_rng(3).random((200, 2))
    error = emulator.series(emulator.predict(z)[0]) - truth(z)
    assert np.sqrt(np.mean(error[:, 15] ** 2)) < 0.5 * SCATTER
    assert np.sqrt(np.mean(error[:, 45] ** 2)) < 0.05 * SCATTER + 0.001


def test_the_doubt_is_as_large_as_the_error(emulator: SeriesEmulator) -> None:
    z = 0.05 + 0.9 * np.random.default_rng(4).random((200, 2))
    mean, variance = emulator.predict(z)
    squares = (emulator.project(truth(z)) - mean) ** 2
    assert 0.2 < np.mean(squares[:, 0]) / np.mean(variance[:, 0]) < 3.0


def test_the_scatter_is_that_of_runs_with_equal_parameters(emulator: SeriesEmulator) -> None:
    z = np.tile([[0.4, 0.6]], (400, 1))
    expected = runs(z, 5).std(axis=0)
    assert emulator.scatter()[15] == pytest.approx(expected[15], rel=0.35)
    assert emulator.scatter()[45] == pytest.approx(expected[45], rel=0.35)


def test_series_and_scores_are_inverse_within_the_components(emulator: SeriesEmulator) -> None:
    scores = np.random.default_rng(6).normal(size=(5, len(emulator.components)))
    assert emulator.project(emulator.series(scores)) == pytest.approx(scores)


def test_a_simulator_that_does_not_scatter_is_followed_closely() -> None:
    z = np.random.default_rng(7).random((40, 2))
    emulator = fit_series(z, truth(z), [30, 30])
    inside = 0.1 + 0.8 * np.random.default_rng(8).random((50, 2))
    error = emulator.series(emulator.predict(inside)[0]) - truth(inside)
    assert np.abs(error).max() < 0.01


def test_too_few_runs_are_refused() -> None:
    z = np.random.default_rng(1).random((7, 2))
    with pytest.raises(ConfigError, match="7 finished runs"):
        fit_series(z, truth(z), [30, 30])


@pytest.mark.parametrize("value", [0.0, 0.5])
def test_a_series_that_never_varies_is_predicted_as_it_is(value: float) -> None:
    z = np.random.default_rng(1).random((12, 2))
    flat = fit_series(z, np.full((12, 30), value), [20, 10])
    mean, variance = flat.predict(z)
    assert flat.series(mean) == pytest.approx(np.full((12, 30), value), abs=1e-9)
    assert np.all(np.isfinite(variance))
    assert np.all(np.isfinite(flat.noise))
    assert flat.scatter().max() < 1e-3 * max(value, 1.0)
