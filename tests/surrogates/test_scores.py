"""What Gaussian processes of scores say of runs left out, and of several points at once."""

import numpy as np
import pytest

from mfopt.arrays import Array, frozen
from surrogates.scores import ScoreProcesses, fit_scores


def scores_at(z: Array, seed: int) -> Array:
    noise = 0.1 * np.random.default_rng(seed).normal(size=(len(z), 2))
    return np.column_stack([np.sin(4.0 * z[:, 0]), z[:, 0] * z[:, 1]]) + noise


def without(its: ScoreProcesses, row: int) -> ScoreProcesses:
    """The same processes with all hyperparameters kept, of all runs but one."""
    kept = np.delete(np.arange(len(its.z)), row)
    centred = np.linalg.solve(its.inverse, its.weights[:, :, None])[:, kept, 0]
    inverse = np.linalg.inv(np.linalg.inv(its.inverse)[:, kept][:, :, kept])
    weights = np.einsum("knm,km->kn", inverse, centred)
    parts = (its.z[kept], its.mean, its.signal, its.lengths, its.noise, inverse, weights)
    return ScoreProcesses(*map(frozen, parts))


@pytest.fixture(scope="module")
def z() -> Array:
    return np.random.default_rng(1).random((25, 2))


@pytest.fixture(scope="module")
def processes(z: Array) -> ScoreProcesses:
    return fit_scores(z, scores_at(z, 2))


def test_left_out_errors_are_those_of_a_process_without_the_run(
    z: Array, processes: ScoreProcesses
) -> None:
    errors, covariance = processes.left_out_errors()
    for row in (0, 7, 24):
        mean, variance = without(processes, row).predict(z[[row]])
        assert errors[row] == pytest.approx(scores_at(z, 2)[row] - mean[0], rel=1e-6)
        expected = np.maximum(variance[0], processes.noise / 24) + processes.noise
        assert covariance[:, row, row] == pytest.approx(expected, rel=1e-6)


def test_left_out_errors_of_drawn_scores_have_the_stated_covariance(
    processes: ScoreProcesses,
) -> None:
    # Errors are linear in the scores: A t, with cov(t) = K, so A K A^T.
    _, covariance = processes.left_out_errors()
    k = np.linalg.inv(processes.inverse[0])
    diagonal = np.diag(processes.inverse[0])
    a = processes.inverse[0] / diagonal[:, None]
    assert covariance[0] == pytest.approx(a @ k @ a.T, rel=1e-6, abs=1e-12)


def test_covariance_has_the_variances_of_single_points_and_is_one_of_a_vector(
    processes: ScoreProcesses,
) -> None:
    at = np.random.default_rng(3).random((6, 2))
    at[1] = at[0] + 1e-4
    covariance = processes.covariance(at)
    assert np.einsum("kmm->mk", covariance) == pytest.approx(processes.predict(at)[1])
    assert np.linalg.eigvalsh(covariance).min() > -1e-9
    neighbours = covariance[:, 0, 1] / covariance[:, 0, 0]
    assert neighbours == pytest.approx(1.0, abs=0.01)
