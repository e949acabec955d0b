"""All hypotheses around one fit, with simulations that are linear in the base parameters.

Near the best fit of nothing the simulated scores are mean + slopes (z - best) + shift(strength).
How likely scores y are at a strength, with the base parameters refitted, is then a quadratic form:

    2 log L = -r' P r - log|C|,    r = y - mean - shift,
    P = C^-1 - C^-1 J (J' C^-1 J + ridge)^-1 J' C^-1

Thousands of drawn recordings are refitted in a second.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.diagnosis.climb import RIDGE, slopes
from calibration.diagnosis.joint import NOTHING, OTHER, Hypothesis, Joint, Suspect
from mfopt.arrays import Array

NODES = 13  # strengths of each hypothesis; of a signed one on each side of zero half as many more


@dataclass(frozen=True, slots=True, eq=False)
class Around:
    """Scores around the best fit of nothing."""

    mean: Array  # (K,)
    factor: Array  # (K, K) of the covariance of recorded less simulated scores
    slopes: Array  # (K, d) by the base parameters
    single: tuple[Hypothesis, ...]  # one for each suspect
    shifts: tuple[Array, ...]  # (m, K) by each suspect, at even strengths
    covariances: tuple[Array, ...]  # (m, K, K) with it
    larger: Array  # (m, K, K) covariances with more and more of what no suspect is

    def gains(self, scores: Array) -> tuple[Array, Array]:
        """How much likelier scores (n, K) are with an effect, at its best strength.

        Returns:
            Log likelihood ratios by each suspect (n, e), and by what no suspect is (n,).
        """
        apart = scores - self.mean
        none = self._log_likelihoods(apart, self.factor @ self.factor.T)
        found = [
            np.max([self._log_likelihoods(apart - s, c) for s, c in zip(*pair, strict=True)], 0)
            for pair in zip(self.shifts, self.covariances, strict=True)
        ]
        other = np.max([self._log_likelihoods(apart, c) for c in self.larger], axis=0)
        return np.array(found).reshape(-1, len(scores)).T - none[:, None], other - none

    def strengths(self, number: int, scores: Array) -> Array:
        """The strengths (n,), as points of the unit cube, at which a suspect explains most."""
        shifts, covariances = self.shifts[number], self.covariances[number]
        apart = scores - self.mean
        each = zip(shifts, covariances, strict=True)
        heights = [self._log_likelihoods(apart - s, c) for s, c in each]
        return np.asarray(np.argmax(heights, axis=0) / (len(shifts) - 1.0))

    def seen(self, shifts: Array) -> Array:
        """Rows (n, K) whose squares are the squared distances after a refit of shifts (n, K)."""
        white = np.linalg.solve(self.factor, np.column_stack([self.slopes, shifts.T]))
        d = self.slopes.shape[1]
        q, _ = np.linalg.qr(white[:, :d])
        rest = white[:, d:] - q @ (q.T @ white[:, d:])
        return np.asarray(rest.T)

    def residuals(self, apart: Array) -> Array:
        """Scores less the mean (n, K) after a refit of the base parameters."""
        white = np.linalg.solve(self.factor, np.column_stack([self.slopes, apart.T]))
        d = self.slopes.shape[1]
        j, r = white[:, :d], white[:, d:]
        steps = np.linalg.solve(j.T @ j + RIDGE * np.eye(d), j.T @ r)
        return np.asarray(apart - (self.slopes @ steps).T)

    def _log_likelihoods(self, apart: Array, covariance: Array) -> Array:
        """Log likelihoods (n,) of scores (n, K) after a refit, but for a constant."""
        factor = np.linalg.cholesky(covariance)
        white = np.linalg.solve(factor, np.column_stack([self.slopes, apart.T]))
        d = self.slopes.shape[1]
        j, r = white[:, :d], white[:, d:]
        step = np.linalg.solve(j.T @ j + RIDGE * np.eye(d), j.T @ r)
        left = np.sum(r**2, axis=0) - np.sum((j.T @ r) * step, axis=0)
        return np.asarray(-0.5 * left - np.log(np.diag(factor)).sum())


def around(joint: Joint, suspects: Sequence[Suspect], best: Array) -> Around:
    """The scores around the best fit (d,) of nothing."""
    point = best[None]
    mean = joint.means(NOTHING, point)
    single = tuple(Hypothesis((s,)) for s in suspects)
    shifts, covariances = [], []
    for which in single:
        points = _at_strengths(best, which.suspects[0].signed)
        shifts.append(joint.means(which, points) - mean)
        covariances.append(joint.covariances(which, points))
    return Around(
        mean[0],
        np.linalg.cholesky(joint.covariances(NOTHING, point))[0],
        slopes(joint, NOTHING, point, len(best), mean)[0],
        single,
        tuple(shifts),
        tuple(covariances),
        joint.covariances(OTHER, _at_strengths(best, signed=False)),
    )


def _at_strengths(best: Array, signed: bool) -> Array:
    nodes = np.linspace(0.0, 1.0, NODES + NODES // 2 if signed else NODES)
    return np.hstack([np.tile(best, (len(nodes), 1)), nodes[:, None]])
