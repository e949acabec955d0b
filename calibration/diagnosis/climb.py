"""The most likely points of a hypothesis, for many recordings at once.

Gauss-Newton steps: the derivatives of the simulated scores come from finite differences. A step
that makes the recordings less likely is shortened. The covariance, which costs most and changes
little, is that of the point at which a round of steps begins.
"""

import math
from dataclasses import dataclass

import numpy as np

from calibration.diagnosis.joint import Hypothesis, Joint, log_densities
from mfopt.arrays import Array

ROUNDS, STEPS = 2, 4
APART = 0.02  # of the unit cube, of finite differences
SHRUNK = 4.0  # times as short is the next step after one that fails
RIDGE = 1e-3  # curvature of a prior over the cube: steps along flat directions stay in it


@dataclass(frozen=True, slots=True, eq=False)
class Climbed:
    """The most likely points, and what is around them."""

    points: Array  # (n, D) in the unit cube: base parameters, then strengths
    log_likelihoods: Array  # (n,)
    misfits: Array  # (n,) chi-squared of the recordings there
    curvature: Array  # (n, f, f) of minus the log likelihood, of the coordinates that moved

    @property
    def log_evidences(self) -> Array:
        """Log evidences (n,) of even priors over the cube, as if each peak were normal."""
        widths = math.log(2.0 * math.pi) / 2.0 - np.log(np.linalg.eigvalsh(self.curvature)) / 2.0
        return np.asarray(self.log_likelihoods + np.sum(np.minimum(widths, 0.0), axis=1))


def climb(
    joint: Joint, which: Hypothesis, scores: Array, start: Array, moving: int | None = None
) -> Climbed:
    """Climb from points (n, D) of the unit cube, for recordings with scores (n, K).

    Only the first `moving` coordinates change; all if None.
    """
    free = start.shape[1] if moving is None else moving
    points, mean = start, joint.means(which, start)
    factor = _factor(joint, which, points)
    value = log_densities(scores - mean, factor)
    for _ in range(ROUNDS):
        tried, new_mean = _round(joint, which, points, free, scores, mean, factor)
        new_factor = _factor(joint, which, tried)
        new = log_densities(scores - new_mean, new_factor)
        better = new > value
        points, mean = (
            np.where(better[:, None], *pair) for pair in ((tried, points), (new_mean, mean))
        )
        factor = np.where(better[:, None, None], new_factor, factor)
        value = np.where(better, new, value)
    white = np.linalg.solve(factor, (scores - mean)[:, :, None])[:, :, 0]
    _, curvature = _step(joint, which, points, free, scores - mean, mean, factor)
    return Climbed(points, value, np.sum(white**2, axis=1), curvature)


def _factor(joint: Joint, which: Hypothesis, points: Array) -> Array:
    """Factors (n, K, K) of the covariances at points (n, D)."""
    return np.asarray(np.linalg.cholesky(joint.covariances(which, points)))


def _round(
    joint: Joint,
    which: Hypothesis,
    points: Array,
    free: int,
    scores: Array,
    mean: Array,
    factor: Array,
) -> tuple[Array, Array]:
    """Points (n, D) after some steps with these factors of the covariances, and their means."""
    value, reach = log_densities(scores - mean, factor), np.ones((len(points), 1))
    for _ in range(STEPS):
        step, _ = _step(joint, which, points, free, scores - mean, mean, factor)
        tried = points.copy()
        tried[:, :free] = np.clip(points[:, :free] + reach * step, 0.0, 1.0)
        new_mean = joint.means(which, tried)
        new = log_densities(scores - new_mean, factor)
        better = new > value
        chosen = better[:, None]
        points, mean = np.where(chosen, tried, points), np.where(chosen, new_mean, mean)
        value = np.where(better, new, value)
        reach = np.where(chosen, np.minimum(1.0, SHRUNK * reach), reach / SHRUNK)
    return points, mean


def slopes(joint: Joint, which: Hypothesis, points: Array, free: int, mean: Array) -> Array:
    """Derivatives (n, K, f) of simulated scores, which are `mean` (n, K) at points (n, D)."""
    n = len(points)
    apart = np.where(points[:, :free] > 0.5, -APART, APART)
    moved = np.tile(points, (free, 1))
    for i in range(free):
        moved[i * n : (i + 1) * n, i] += apart[:, i]
    found = joint.means(which, moved).reshape(free, n, -1)
    return np.asarray(((found - mean) / apart.T[:, :, None]).transpose(1, 2, 0))


def _step(
    joint: Joint,
    which: Hypothesis,
    points: Array,
    free: int,
    residual: Array,
    mean: Array,
    factor: Array,
) -> tuple[Array, Array]:
    """Gauss-Newton steps (n, f), and the curvatures (n, f, f)."""
    its = slopes(joint, which, points, free, mean)
    white = np.linalg.solve(factor, np.concatenate([its, residual[:, :, None]], axis=2))
    j, r = white[:, :, :free], white[:, :, free:]
    turned = j.transpose(0, 2, 1)
    curvature = turned @ j + RIDGE * np.eye(free)
    return np.asarray(np.linalg.solve(curvature, turned @ r)[:, :, 0]), curvature
