import numpy as np
import pytest
from surrogate_cases import rosenbrock, runs, sphere

from mfopt.arrays import Array
from surrogates.autoregressive import AutoregressiveGp
from surrogates.gaussian_process import Process, condition
from surrogates.levels_posterior import LevelsPosterior
from surrogates.training import subset


@pytest.fixture(scope="module")
def posterior() -> LevelsPosterior:
    """Two levels, replicates with noise and a failed run."""
    rng = np.random.default_rng(4)
    z = rng.standard_normal((45, 3))
    z[40:] = z[:5]
    level = np.repeat([0, 1, 0], [25, 15, 5])
    value = np.where(level == 1, rosenbrock(z), rosenbrock(z) + 2.0 * sphere(z))
    value = value + rng.standard_normal(45)
    value[7] = np.inf
    return AutoregressiveGp().fit(runs(z, value, level))


@pytest.fixture(scope="module")
def process(posterior: LevelsPosterior) -> Process:
    return posterior.main


@pytest.fixture(scope="module")
def points() -> Array:
    return np.random.default_rng(5).standard_normal((6, 3))


def test_left_out_equals_conditioning_on_all_other_rows(process: Process) -> None:
    mean, variance = process.left_out()
    noise = process.hyperparameters.noise_variances
    for i in range(0, len(mean), 5):
        others = np.delete(np.arange(len(mean)), i)
        rest = condition(
            subset(process.rows, others), process.scaling, process.warp, process.hyperparameters
        )
        k = int(process.rows.index[i])
        level = process.rows.levels[k]
        m, v = rest.mean_variance(process.rows.z[i : i + 1], level)
        v = v + noise[k] / process.rows.replicates[i] * process.scaling.scale**2
        np.testing.assert_allclose(mean[i], m[0], rtol=1e-6)
        np.testing.assert_allclose(variance[i], v[0], rtol=1e-6)


@pytest.mark.parametrize("level", [0, 1])
def test_gradient_equals_finite_differences(process: Process, points: Array, level: int) -> None:
    mean, gradient = process.mean_gradient(points, level)
    np.testing.assert_allclose(mean, process.mean_variance(points, level)[0], rtol=1e-9)
    h = 1e-5
    for j in range(3):
        step = h * np.eye(3)[j]
        ahead, behind = process.mean(points + step, level), process.mean(points - step, level)
        np.testing.assert_allclose(gradient[:, j], (ahead - behind) / (2.0 * h), rtol=1e-4)


def test_draws_have_the_predicted_mean_and_covariance(process: Process, points: Array) -> None:
    mean, covariance = process.mean_covariance(points, 1)
    draws = process.sample(points, 1, 100_000, np.random.default_rng(6))
    scale = np.sqrt(np.diag(covariance))
    error = np.abs(np.cov(draws.T) - covariance) / np.outer(scale, scale)
    assert error.max() < 0.02
    assert np.max(np.abs(draws.mean(axis=0) - mean) / scale) < 0.02
    np.testing.assert_allclose(process.mean_variance(points, 1)[1], np.diag(covariance), rtol=1e-9)


def test_a_level_without_runs_is_answered_by_the_one_below(process: Process, points: Array) -> None:
    np.testing.assert_array_equal(process.mean(points, 5), process.mean(points, 1))
