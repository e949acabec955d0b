"""One autoregressive Gaussian process, conditioned on its rows; numpy and scipy only.

f_0 = g_0, f_l = rho_l f_{l-1} + g_l, with independent g_l of covariance

    1 + signal_variance * Matern-5/2(r) + trend_variance * (offset + x.x'/d)^2
      + separable_variance * sum_i (x_i x'_i + (x_i^2 - 1) (x'_i^2 - 1) / 2) / d.

The last two terms learn a quadratic function exactly: from (d + 1)(d + 2) / 2 points in general,
from 2 d + 1 points if the axes are those of the inputs. With noise they need far fewer points than
the Matern term.

Source: Kennedy & O'Hagan, Biometrika 87 (2000), 1-13; Rasmussen & Williams (2006), eqs. 2.25,
2.26 (posterior), 5.12 (leave-one-out).
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_solve, cholesky, solve_triangular
from scipy.spatial.distance import cdist

from mfopt.arrays import Array
from mfopt.search.surrogate import Hyperparameters
from surrogates.training import Rows, Scaling, outputs
from surrogates.warp import Warp

CONSTANT_VARIANCE = 1.0  # prior variance of a level's constant, in variances of its values
JITTERS = (0.0, 1e-10, 1e-8, 1e-6, 1e-4, 1e-2)  # relative to the mean diagonal


def weights(rho: Array) -> Array:
    """G (levels, levels): f_p = sum over l <= p of G[l, p] g_l."""
    count = len(rho)
    table = np.eye(count)
    for p in range(1, count):
        table[:p, p] = rho[p] * table[:p, p - 1]
    return table


def component(x: Array, other: Array, hyperparameters: Hyperparameters, k: int) -> Array:
    """Covariance (n, m) of g_k between standardised inputs (n, d) and (m, d)."""
    h = hyperparameters
    a = np.sqrt(5.0) * cdist(x / h.lengthscales[k], other / h.lengthscales[k])
    matern = (1.0 + a + a**2 / 3.0) * np.exp(-a)
    trend = (h.trend_offsets[k] + x @ other.T / x.shape[1]) ** 2
    separable = (x @ other.T + (x**2 - 1.0) @ (other**2 - 1.0).T / 2.0) / x.shape[1]
    result: Array = CONSTANT_VARIANCE + h.signal_variances[k] * matern
    result += h.trend_variances[k] * trend + h.separable_variances[k] * separable
    return result


def component_diagonal(x: Array, hyperparameters: Hyperparameters, k: int) -> Array:
    """Variance (n,) of g_k."""
    h = hyperparameters
    trend = (h.trend_offsets[k] + (x**2).mean(axis=1)) ** 2
    separable = (x**2 + (x**2 - 1.0) ** 2 / 2.0).mean(axis=1)
    result: Array = CONSTANT_VARIANCE + h.signal_variances[k] + h.trend_variances[k] * trend
    result += h.separable_variances[k] * separable
    return result


def factor(covariance: Array) -> Array:
    """Lower Cholesky factor; the diagonal is raised until a factor exists."""
    scale = max(float(np.mean(np.diag(covariance))), np.finfo(float).tiny)
    for jitter in JITTERS:
        try:
            raised = covariance + jitter * scale * np.eye(len(covariance))
            result: Array = cholesky(raised, lower=True, check_finite=False)
        except np.linalg.LinAlgError:
            continue
        return result
    raise np.linalg.LinAlgError("covariance matrix is far from positive definite")


@dataclass(frozen=True, slots=True, eq=False)
class Process:
    """The process after conditioning; means and variances are in transformed units."""

    rows: Rows
    scaling: Scaling
    warp: Warp
    hyperparameters: Hyperparameters
    x: Array  # (n, d) standardised
    y: Array  # (n,) standardised
    cholesky: Array  # (n, n) lower factor of the covariance of `y`
    alpha: Array  # (n,) covariance^-1 y

    def position(self, level: int) -> int:
        """The observed level used for `level`: the nearest below, or the coarsest."""
        return max(0, int(np.searchsorted(self.rows.levels, level, side="right")) - 1)

    def _cross(self, x: Array, p: int) -> Array:
        """Covariance (m, n) of f_p at `x` (m, d) with the rows' noise-free values."""
        table, starts = weights(self.hyperparameters.rho), self.rows.starts
        result = np.zeros((len(x), len(self.x)))
        for k in range(p + 1):
            own = slice(starts[k], None)
            covariance = component(x, self.x[own], self.hyperparameters, k)
            result[:, own] += table[k, p] * table[k, self.rows.index[own]] * covariance
        return result

    def mean(self, z: Array, level: int) -> Array:
        """Posterior mean (m,)."""
        p = self.position(level)
        cross = self._cross(self.scaling.inputs(z), p)
        result: Array = self.scaling.centre[p] + self.scaling.scale * (cross @ self.alpha)
        return result

    def mean_variance(self, z: Array, level: int) -> tuple[Array, Array]:
        """Posterior mean (m,) and variance (m,)."""
        p, x = self.position(level), self.scaling.inputs(z)
        cross, table = self._cross(x, p), weights(self.hyperparameters.rho)
        prior = np.zeros(len(x))
        for k in range(p + 1):
            prior += table[k, p] ** 2 * component_diagonal(x, self.hyperparameters, k)
        half = solve_triangular(self.cholesky, cross.T, lower=True, check_finite=False)
        variance = np.maximum(prior - (half**2).sum(axis=0), 1e-12 * prior)
        centre, scale = self.scaling.centre[p], self.scaling.scale
        return centre + scale * (cross @ self.alpha), scale**2 * variance

    def mean_covariance(self, z: Array, level: int) -> tuple[Array, Array]:
        """Posterior mean (m,) and joint covariance (m, m)."""
        p, x = self.position(level), self.scaling.inputs(z)
        cross, table = self._cross(x, p), weights(self.hyperparameters.rho)
        prior = np.zeros((len(x), len(x)))
        for k in range(p + 1):
            prior += table[k, p] ** 2 * component(x, x, self.hyperparameters, k)
        half = solve_triangular(self.cholesky, cross.T, lower=True, check_finite=False)
        centre, scale = self.scaling.centre[p], self.scaling.scale
        return centre + scale * (cross @ self.alpha), scale**2 * (prior - half.T @ half)

    def mean_gradient(self, z: Array, level: int) -> tuple[Array, Array]:
        """Posterior mean (m,) and its gradient (m, d)."""
        h, p, x = self.hyperparameters, self.position(level), self.scaling.inputs(z)
        table, starts, d = weights(h.rho), self.rows.starts, x.shape[1]
        mean, gradient = np.zeros(len(x)), np.zeros_like(x)
        for k in range(p + 1):
            own = slice(starts[k], None)
            other = self.x[own]
            v = self.alpha[own] * table[k, p] * table[k, self.rows.index[own]]
            a = np.sqrt(5.0) * cdist(x / h.lengthscales[k], other / h.lengthscales[k])
            decay, inner = np.exp(-a), h.trend_offsets[k] + x @ other.T / d
            mean += CONSTANT_VARIANCE * v.sum() + h.trend_variances[k] * (inner**2 @ v)
            mean += h.signal_variances[k] * ((1.0 + a + a**2 / 3.0) * decay @ v)
            pull = (1.0 + a) * decay * v
            toward = pull @ other - pull.sum(axis=1)[:, None] * x
            gradient += h.signal_variances[k] * 5.0 / 3.0 * toward / h.lengthscales[k] ** 2
            gradient += h.trend_variances[k] * 2.0 / d * (inner * v) @ other
            bent = v @ (other**2 - 1.0)
            mean += h.separable_variances[k] / d * (x @ (v @ other) + (x**2 - 1.0) @ bent / 2.0)
            gradient += h.separable_variances[k] / d * (v @ other + x * bent)
        centre, scale = self.scaling.centre[p], self.scaling.scale
        return centre + scale * mean, scale * gradient / self.scaling.z_scale

    def sample(self, z: Array, level: int, draws: int, rng: np.random.Generator) -> Array:
        """Joint draws (draws, m) on the transformed scale."""
        mean, covariance = self.mean_covariance(z, level)
        return mean + rng.standard_normal((draws, len(z))) @ factor(covariance).T

    def left_out(self) -> tuple[Array, Array]:
        """Leave-one-out mean (n,) and variance (n,) of the rows' means, noise included."""
        inverse_factor = solve_triangular(
            self.cholesky, np.eye(len(self.y)), lower=True, check_finite=False
        )
        precision = (inverse_factor**2).sum(axis=0)
        centre, scale = self.scaling.centre[self.rows.index], self.scaling.scale
        return centre + scale * (self.y - self.alpha / precision), scale**2 / precision

    def noise_variance(self, level: int) -> float:
        """Noise variance of one run."""
        p = self.position(level)
        return float(self.hyperparameters.noise_variances[p] * self.scaling.scale**2)

    @property
    def observed(self) -> Array:
        """Transformed means (n,) of the rows' runs."""
        centre, scale = self.scaling.centre[self.rows.index], self.scaling.scale
        return centre + scale * self.y


def condition(
    rows: Rows, scaling: Scaling, warp: Warp, hyperparameters: Hyperparameters
) -> Process:
    """Condition the process on its rows: one Cholesky factorisation."""
    x, y = scaling.inputs(rows.z), outputs(rows, warp, scaling)
    table, starts = weights(hyperparameters.rho), rows.starts
    covariance = np.diag(hyperparameters.noise_variances[rows.index] / rows.replicates)
    for k in range(len(rows.levels)):
        own = slice(starts[k], None)
        g = table[k, rows.index[own]]
        covariance[own, own] += g[:, None] * g * component(x[own], x[own], hyperparameters, k)
    lower = factor(covariance)
    return Process(rows, scaling, warp, hyperparameters, x, y, lower, cho_solve((lower, True), y))
