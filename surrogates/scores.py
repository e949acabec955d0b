"""Gaussian processes of several scores over the same runs, each with hyperparameters of its own.

The kernel is Matern's with nu = 5/2: one of infinitely smooth functions is too sure of itself where
a few dozen runs lie in four dimensions.

Source: Rasmussen & Williams 2006, ch. 4.2 and 5.4.
"""

import warnings
from dataclasses import dataclass

import numpy as np

from mfopt.arrays import Array, frozen

NARROWEST, WIDEST = 0.15, 20.0  # length scales in the unit cube
LEAST_NOISE = 1e-6  # of a score's variance
RESTARTS = 1
FITTED = 3  # mean, signal and noise, beside a length for each parameter


@dataclass(frozen=True, slots=True, eq=False)
class ScoreProcesses:
    """k independent processes t_j(z) = mean_j + GP(0, signal_j M(z / length_j) + noise_j)."""

    z: Array  # (n, d) in the unit cube
    mean: Array  # (k,)
    signal: Array  # (k,) variance
    lengths: Array  # (k, d)
    noise: Array  # (k,) variance
    inverse: Array  # (k, n, n) of the covariance of the runs
    weights: Array  # (k, n): inverse times (scores - mean)

    def predict(self, z: Array) -> tuple[Array, Array]:
        """Mean and variance (m, k) of the noise-free scores at points (m, d).

        The variance is at least that of the mean of all runs: a process that finds no influence of
        the parameters knows its mean no better.
        """
        near = self._near(z)
        mean = self.mean + np.einsum("kmn,kn->mk", near, self.weights)
        explained = np.einsum("kmn,kmn->mk", near @ self.inverse, near)
        return mean, np.maximum(self._variance(z) - explained, self.noise / len(self.z))

    def mean_at(self, z: Array) -> Array:
        """Mean (m, k) at points (m, d), as `predict` gives it, without the variance."""
        return np.asarray(self.mean + np.einsum("kmn,kn->mk", self._near(z), self.weights))

    def covariance(self, z: Array) -> Array:
        """Covariance (k, m, m) of the noise-free scores between points (m, d).

        The diagonal is the variance of `predict`.
        """
        near = self._near(z)
        explained = near @ self.inverse @ near.transpose(0, 2, 1)
        covariance = self._between(z) - explained
        place = range(len(z))
        covariance[:, place, place] = self.predict(z)[1].T
        return np.asarray(covariance)

    def _near(self, z: Array) -> Array:
        """Covariance (k, m, n), before any run, of points (m, d) and runs."""
        return _kernel(z, self.z, self.signal, self.lengths)

    def _between(self, z: Array) -> Array:
        """Covariance (k, m, m), before any run, of points (m, d)."""
        return _kernel(z, z, self.signal, self.lengths)

    def _variance(self, z: Array) -> Array:
        """Variance (m, k), before any run, of points (m, d)."""
        return np.tile(self.signal, (len(z), 1))

    def left_out(self, scores: Array) -> Array:
        """Predictions (n, k) of each run from all others.

        Source: Rasmussen & Williams 2006, eq. 5.12.
        """
        diagonal = np.einsum("knn->kn", self.inverse)
        return np.asarray(scores - (self.weights / diagonal).T)

    def left_out_errors(self) -> tuple[Array, Array]:
        """Score of each run less the prediction from all others (n, k), their covariance (k, n, n).

        With D the diagonal of the inverse of K: error D^-1 K^-1 (t - mean), covariance
        D^-1 K^-1 D^-1, so each variance, noise included, is 1 / D.

        Source: Sundararajan & Keerthi 2001, doi:10.1162/08997660151134343.
        """
        diagonal = np.einsum("knn->kn", self.inverse)
        covariance = self.inverse / diagonal[:, :, None] / diagonal[:, None, :]
        return np.asarray((self.weights / diagonal).T), np.asarray(covariance)


def fit_scores(z: Array, scores: Array) -> ScoreProcesses:
    """Fit each score by maximum likelihood; z (n, d) in the unit cube, scores (n, k).

    The variances are those of maximum likelihood times n / (n - number of fitted values), as in a
    regression.
    """
    n, d = z.shape
    fair = n / max(n - d - FITTED, 1)
    means = scores.mean(axis=0)
    fitted = [_fit(z, s - m) for s, m in zip(scores.T, means, strict=True)]
    signal, noise = (fair * np.array([f[i] for f in fitted]) for i in (0, 2))
    lengths = np.array([f[1] for f in fitted]).reshape(-1, d)
    kernel = _kernel(z, z, signal, lengths) + noise[:, None, None] * np.eye(len(z))
    inverse = np.linalg.inv(kernel)
    weights = np.einsum("knm,mk->kn", inverse, scores - means)
    parts = (z, means, signal, lengths, noise, inverse, weights)
    return ScoreProcesses(*(frozen(part) for part in parts))


def _fit(z: Array, scores: Array) -> tuple[float, Array, float]:
    """Signal variance, length scales (d,) and noise variance of one score."""
    from sklearn.exceptions import ConvergenceWarning
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

    variance = float(scores.var()) or 1.0
    kernel = ConstantKernel(1.0, (1e-4, 1e4)) * Matern(
        np.ones(z.shape[1]), (NARROWEST, WIDEST), nu=2.5
    ) + WhiteKernel(0.1, (LEAST_NOISE, 2.0))
    process = GaussianProcessRegressor(kernel, n_restarts_optimizer=RESTARTS, random_state=0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # a length scale at its bound
        process.fit(z, scores / np.sqrt(variance))
    found = process.kernel_
    return (
        variance * float(found.k1.k1.constant_value),
        np.atleast_1d(found.k1.k2.length_scale),
        variance * float(found.k2.noise_level),
    )


def _kernel(a: Array, b: Array, signal: Array, lengths: Array) -> Array:
    """Covariances (k, m, n) of points (m, d) and (n, d)."""
    left, right = a[None] / lengths[:, None], b[None] / lengths[:, None]
    squared = (
        np.sum(left**2, axis=2)[:, :, None]
        + np.sum(right**2, axis=2)[:, None, :]
        - 2.0 * left @ right.transpose(0, 2, 1)
    )
    far = np.sqrt(5.0 * np.maximum(squared, 0.0))
    return np.asarray(signal[:, None, None] * (1.0 + far + far**2 / 3.0) * np.exp(-far))


def correlation(a: Array, b: Array, lengths: Array) -> Array:
    """Matern's correlations (k, m, n) of points (m, d) and (n, d)."""
    return _kernel(a, b, np.ones(len(lengths)), lengths)
