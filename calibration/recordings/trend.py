"""A smooth trend with autocorrelated noise around it, for repeats that share most of the trend.

Repeat i is y_i(t) = m(t) + d_i(t) + e_i(t): the trend m is a spline with many knots, the deviation
d_i one with few knots and a sum of 0 over the repeats, and e_i is noise with the covariance
sigma^2 exp(-|dt| / tau), which a transformation to independent noise needs only neighbours for.

Source: restricted likelihood, Patterson and Thompson 1971, doi:10.1093/biomet/58.3.545.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.interpolate import BSpline
from scipy.linalg import helmert

from mfopt.arrays import Array

DEGREE = 3
RIDGE = 1e-10  # of the largest diagonal element; keeps functions without samples defined


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Repeats of one recording, on times of their own."""

    times: Sequence[Array]  # (n_i,) [s] each, increasing
    values: Sequence[Array]  # (n_i,) each

    @property
    def samples(self) -> int:
        """Number of all samples."""
        return sum(t.size for t in self.times)

    @property
    def span(self) -> tuple[float, float]:
        """First and last time [s]."""
        return min(float(t[0]) for t in self.times), max(float(t[-1]) for t in self.times)


@dataclass(frozen=True, slots=True)
class Basis:
    """Number of spline functions of the shared trend and of each deviation."""

    shared: int
    own: int


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """A trend fitted at one autocorrelation time."""

    squares: float  # sum of squares of the independent residuals
    freedom: int  # samples minus functions
    log_det: float  # of the transformation, and of the normal equations
    log_det_noise: float  # of the transformation alone


def basis_matrix(times: Array, span: tuple[float, float], functions: int) -> sparse.csr_matrix:
    """Values (n, functions) of cubic B-splines with equal knots over the span."""
    begin, end = span
    inner = np.linspace(begin, end, functions - DEGREE + 1)
    knots = np.concatenate([[begin] * DEGREE, inner, [end] * DEGREE])
    return BSpline.design_matrix(np.clip(times, begin, end), knots, DEGREE).tocsr()


def contrasts(repeats: int) -> Array:
    """Orthonormal columns (r, r - 1) that sum to 0: deviations of repeats from their mean."""
    return np.asarray(helmert(repeats)).T if repeats > 1 else np.zeros((1, 0))


def design(group: Group, basis: Basis) -> sparse.csr_matrix:
    """The matrix (n, functions) of trend and deviations, repeats one below the other."""
    weights = contrasts(len(group.times))
    rows = []
    for times, weight in zip(group.times, weights, strict=True):
        shared = basis_matrix(times, group.span, basis.shared)
        own = basis_matrix(times, group.span, basis.own)
        rows.append(sparse.hstack([shared, *(float(w) * own for w in weight)]))
    return sparse.vstack(rows).tocsr()


def whitening(group: Group, tau: float) -> tuple[sparse.csr_matrix, float]:
    """Matrix (n, n) that makes the noise independent with sd sigma, and log-det of covariance."""
    blocks, log_det = [], 0.0
    for times in group.times:
        decay = np.exp(-np.diff(times) / tau) if tau > 0.0 else np.zeros(times.size - 1)
        scale = np.sqrt(-np.expm1(2.0 * np.log(np.maximum(decay, 1e-300))))
        diagonal = np.concatenate([[1.0], 1.0 / scale])
        blocks.append(sparse.diags([diagonal, -decay / scale], [0, -1]))
        log_det += 2.0 * float(np.sum(np.log(scale)))
    return sparse.block_diag(blocks).tocsr(), log_det


def fit(group: Group, matrix: sparse.csr_matrix, tau: float) -> Fit:
    """Generalised least squares at an autocorrelation time [s]."""
    white, log_det_noise = whitening(group, tau)
    a, y = (white @ matrix), white @ np.concatenate(group.values)
    normal = (a.T @ a).toarray()
    normal[np.diag_indices_from(normal)] += RIDGE * float(np.max(np.diag(normal)))
    factor = np.linalg.cholesky(normal)
    half = np.linalg.solve(factor, a.T @ y)
    coefficients = np.linalg.solve(factor.T, half)
    squares = float(np.sum((y - a @ coefficients) ** 2))
    log_det = log_det_noise + 2.0 * float(np.sum(np.log(np.diag(factor))))
    freedom = y.size - matrix.shape[1]
    return Fit(squares, freedom, log_det, log_det_noise)


def restricted(fits: Sequence[Fit]) -> float:
    """-2 log restricted likelihood of one noise for all groups, at the best sigma."""
    freedom = sum(f.freedom for f in fits)
    squares = max(sum(f.squares for f in fits), 1e-300)
    return freedom * math.log(squares / freedom) + sum(f.log_det for f in fits)


def information(its: Fit, samples: int) -> float:
    """Schwarz's criterion of a trend; trends with different functions compare by it."""
    functions = samples - its.freedom
    squares = max(its.squares, 1e-300)
    return samples * math.log(squares / samples) + its.log_det_noise + functions * math.log(samples)
