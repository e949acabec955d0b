"""How likely all recordings are under a hypothesis: base parameters and effects of known strength.

The errors are those of `calibration.likelihood`. Many points are taken at once.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag

from calibration.likelihood import LEAST, SHARED, WAVES, Group, Likelihood, with_scores
from mfopt.arrays import AnyArray, Array, frozen
from surrogates.series import with_effects

UNSEEN = 1e3  # [standard deviations over all runs] error of a point that does not count
# What no suspect explains, times the allowance. Its slow waves are as large as that, the k-th is
# 1 / (1 + k) of it.
SMALLEST, LARGEST = 0.5, 100.0


@dataclass(frozen=True, slots=True)
class Suspect:
    """An effect that may be there."""

    name: str
    number: int  # among the effects of the rig, or among those of measuring
    measuring: bool
    signed: bool  # strengths from -1 to 1, else from 0


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """What is there beside the base parameters.

    Its points lie in the unit cube: base parameters, in the cube of their priors, then the strength
    of each suspect, then the size of what no suspect is.
    """

    suspects: tuple[Suspect, ...] = ()
    other: bool = False  # something that no suspect is; its size is the last parameter

    @property
    def name(self) -> str:
        """Its effects, or `nothing`."""
        return " + ".join(s.name for s in self.suspects) or ("other" if self.other else "nothing")

    @property
    def added(self) -> int:
        """Parameters beside the base."""
        return len(self.suspects) + self.other

    def strengths(self, u: Array) -> Array:
        """Strengths (n, m) at points (n, m) of the unit cube."""
        signed = np.array([*(s.signed for s in self.suspects), *[False] * self.other], dtype=bool)
        return np.where(signed, 2.0 * u - 1.0, u)


NOTHING, OTHER = Hypothesis(), Hypothesis(other=True)


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """All recordings, in scores."""

    likelihood: Likelihood  # its emulators know all effects of the rig
    shapes: tuple[tuple[Array, ...], ...]  # by recording and measuring effect, (m, q, k + 1)
    transform: Callable[[Array], Array]  # from the cube of the priors (d, n) to that of the ranges
    deviations: tuple[Array, ...]  # by recording, (p,): of the mean of its repeats

    @property
    def scores(self) -> Array:
        """Scores (K,) of the recordings."""
        return self.likelihood.scores

    def of(self, chosen: Sequence[int]) -> "Joint":
        """Only these recordings."""
        groups = tuple(self.likelihood.groups[i] for i in chosen)
        shapes = tuple(self.shapes[i] for i in chosen)
        return replace(
            self, likelihood=replace(self.likelihood, groups=groups), shapes=shapes,
            deviations=tuple(self.deviations[i] for i in chosen),
        )  # fmt: skip

    def having(self, scores: Array) -> "Joint":
        """The same recordings with other scores (K,), such as drawn ones."""
        return replace(self, likelihood=with_scores(self.likelihood, scores))

    def blind(self, out: Sequence[AnyArray]) -> tuple["Joint", int]:
        """The same recordings without some points, and how many scores that costs.

        Args:
            out: for each recording whether a point of its row is left out (p,).
        """
        groups, lost = [], 0
        for group, points in zip(self.likelihood.groups, out, strict=True):
            at = group.basis[:, points] * (UNSEEN / np.sqrt(len(points)))
            lost += int(np.linalg.matrix_rank(at))
            groups.append(replace(group, fixed=frozen(group.fixed + at @ at.T)))
        return replace(self, likelihood=replace(self.likelihood, groups=tuple(groups))), lost

    def means(self, which: Hypothesis, points: Array) -> Array:
        """Simulated scores (n, K) at points (n, D)."""
        z, strengths, numbers = self._placed(which, points)
        found = []
        for group, shapes in zip(self.likelihood.groups, self.shapes, strict=True):
            mean = with_effects(group.emulator, numbers).scores.mean_at(z)
            whole = np.hstack([mean, np.zeros((len(mean), len(group.scores) - mean.shape[1]))])
            with_one = _with_one(mean)
            for suspect, s in zip(which.suspects, strengths.T, strict=False):
                if suspect.measuring:
                    whole += _changed(shapes[suspect.number], suspect.signed, s, with_one)
            found.append(whole)
        return np.hstack(found)

    def covariances(self, which: Hypothesis, points: Array) -> Array:
        """Covariances (n, K, K) of recorded less simulated scores at points (n, D)."""
        z, strengths, numbers = self._placed(which, points)
        predicted = (
            (group, *with_effects(group.emulator, numbers).predict(z))
            for group in self.likelihood.groups
        )
        total = self._together([_own(group, mean, doubt) for group, mean, doubt in predicted])
        if which.other:
            larger = SMALLEST * (LARGEST / SMALLEST) ** strengths[:, -1]
            total += (larger**2)[:, None, None] * self.unknown()
        return total

    def _placed(self, which: Hypothesis, points: Array) -> tuple[Array, Array, list[int]]:
        """Points of the emulators (n, d + ...), strengths (n, m), and numbers of the rig's effects.

        The strength of a rig's effect follows the base parameters.
        """
        d = points.shape[1] - which.added
        strengths = which.strengths(points[:, d:])
        rig = [i for i, s in enumerate(which.suspects) if not s.measuring]
        z = self.transform(points[:, :d].T).T
        numbers = [which.suspects[i].number for i in rig]
        return np.hstack([z, strengths[:, rig]]), strengths, numbers

    def unknown(self) -> Array:
        """Covariance (K, K) of what no suspect explains, where it is as large as the allowance."""
        falling = 1.0 / (1.0 + np.arange(WAVES))
        factors = [
            group.shared * np.tile(falling, group.shared.shape[1] // WAVES)
            for group in self.likelihood.groups
        ]
        together = np.concatenate(factors)
        alone = block_diag(*(f @ f.T for f in factors))
        return np.asarray(together @ together.T + (1.0 - SHARED) / SHARED * alone)

    def _together(self, own: Sequence[Array]) -> Array:
        """Covariances (n, K, K) of all recordings from those of each, and what these share."""
        factor = np.concatenate([group.shared for group in self.likelihood.groups])
        total, at = np.tile(factor @ factor.T, (len(own[0]), 1, 1)), 0
        for covariance in own:
            k = covariance.shape[1]
            total[:, at : at + k, at : at + k] += covariance
            at += k
        places = range(at)
        total[:, places, places] *= 1.0 + LEAST
        return total

    def as_recorded(self, number: int, which: Hypothesis, points: Array, scores: Array) -> Array:
        """Scores (n, q) of a recording from those of physics (n, q) and how it is measured."""
        _, strengths, _ = self._placed(which, points)
        group, shapes = self.likelihood.groups[number], self.shapes[number]
        with_one = _with_one(scores[:, : len(group.emulator.components)])
        whole = scores.copy()
        for suspect, s in zip(which.suspects, strengths.T, strict=False):
            if suspect.measuring:
                whole += _changed(shapes[suspect.number], suspect.signed, s, with_one)
        return whole


def _own(group: Group, mean: Array, doubt: Array) -> Array:
    """Covariances (n, q, q) of one recording at mean scores (n, k) of this variance (n, k)."""
    with_one = _with_one(mean)
    covariance = np.tile(group.fixed, (len(mean), 1, 1))
    for matrix, sd in ((group.slope, group.start_sd), (group.moment, group.clock_error)):
        column = sd * (with_one @ matrix.T)
        covariance += column[:, :, None] * column[:, None, :]
    places = range(mean.shape[1])
    covariance[:, places, places] += doubt
    return covariance


def _with_one(mean: Array) -> Array:
    return np.hstack([mean, np.ones((len(mean), 1))])


def _changed(shape: Array, signed: bool, s: Array, with_one: Array) -> Array:
    """What an effect of measuring of strengths (n,) adds to scores: (n, q).

    Args:
        shape: at even strengths from -1 (or 0) to 1, (m, q, k + 1).
        signed: whether strengths start at -1.
        s: strengths.
        with_one: simulated scores and 1 (n, k + 1).
    """
    lowest = -1.0 if signed else 0.0
    apart = (1.0 - lowest) / (len(shape) - 1)
    low = np.clip(((s - lowest) / apart).astype(int), 0, len(shape) - 2)
    left = lowest + low * apart
    # Sizes grow with the square of the strength, and the change with the size.
    whole = _squared(left + apart) - _squared(left)
    part = ((_squared(s) - _squared(left)) / whole)[:, None]
    ends = [np.einsum("nqk,nk->nq", shape[low + i], with_one) for i in (0, 1)]
    return np.asarray((1.0 - part) * ends[0] + part * ends[1])


def _squared(s: Array) -> Array:
    return s * np.abs(s)


def log_densities(residuals: Array, factor: Array) -> Array:
    """Log normal densities (n,) of residuals (n, K) with these factors (n, K, K) of covariances."""
    white = np.linalg.solve(factor, residuals[:, :, None])[:, :, 0]
    log_det = 2.0 * np.sum(np.log(np.diagonal(factor, axis1=1, axis2=2)), axis=1)
    size = residuals.shape[1] * math.log(2.0 * math.pi)
    return np.asarray(-0.5 * (np.sum(white**2, axis=1) + log_det + size))
