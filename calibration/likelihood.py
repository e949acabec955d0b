"""How likely recordings are at given parameters, with every error that is known of.

The scores of all recordings together are one Gaussian vector. A recording has scores on the
components of its emulator, and on directions in which no simulation goes but a wrong model, or an
error of zero, scale or clock, can: else these could not be told from a parameter. The covariance
adds, by recording,

    packing / repeats + measurement noise / repeats + doubt of the emulator
    + zero and scale of each channel + clock (slope of the series times its error)
    + allowance for the difference between engine and reality, partly shared by all recordings.

Each part can be left out (`calibration.parts.Parts`).
"""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from calibration.observed import Observed
from calibration.parts import ALLOWANCE, EVERY_PART, Parts
from mfopt.arrays import Array, frozen
from surrogates.series import SeriesEmulator

SHARED = 0.5  # of its variance, by all recordings
WAVES = 8  # cosines over the run: the shortest lasts a quarter of it
INDEPENDENT = 1e-6  # of a direction's size: what is left of it beside the components
SLIGHTLY = 1e-3  # of a misfit, by which parameters that are not ruled out differ
LEAST = 1e-9  # [of a score's variance] added to the diagonal


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """One recording, in scores."""

    emulator: SeriesEmulator
    basis: Array  # (q, p) orthonormal; the first k rows are the components of the emulator
    scores: Array  # (q,) of the recording
    fixed: Array  # (q, q) covariance that does not depend on the parameters
    shared: Array  # (q, r) factor of what all recordings have in common
    slope: Array  # (q, k + 1): of the series in time, from the simulated scores and 1
    moment: Array  # (q, k + 1): the same times the time
    clock_error: float
    start_sd: float


@dataclass(frozen=True, slots=True, eq=False)
class Likelihood:
    """Log density of all recordings at parameters in the unit cube."""

    groups: tuple[Group, ...]
    parts: Parts

    @property
    def scores(self) -> Array:
        """Scores (K,) of all recordings."""
        return np.concatenate([group.scores for group in self.groups])

    def __call__(self, z: Array) -> float:
        """Log likelihood at z (d,)."""
        residual, covariance = self.residual(z)
        try:
            factor = cho_factor(covariance, lower=True)
        except np.linalg.LinAlgError:
            return -math.inf
        log_det = 2.0 * float(np.sum(np.log(np.diag(factor[0]))))
        squares = float(residual @ cho_solve(factor, residual))
        return -0.5 * (squares + log_det + len(residual) * math.log(2.0 * math.pi))

    def residual(self, z: Array) -> tuple[Array, Array]:
        """Recorded less simulated scores (K,) of all recordings, and their covariance (K, K)."""
        residuals, own = [], []
        for group in self.groups:
            mean, variance = (a[0] for a in group.emulator.predict(z[None]))
            covariance, k = self._known(group, mean), len(mean)
            if self.parts.emulator:
                covariance[range(k), range(k)] += variance
            residual = group.scores.copy()
            residual[:k] -= mean
            residuals.append(residual)
            own.append(covariance)
        return np.concatenate(residuals), self._together(own)

    def ruled_out(self, z: Array) -> float:
        """How far parameters z (d,) are ruled out, as a log density: 0 if they are not.

        Parameters are ruled out by a misfit that is larger than its number of scores. Where the
        emulator is in doubt nothing is, so runs there tell more. Among equals a smaller misfit
        counts for little more.

        Source: Vernon, Goldstein & Bower 2010, doi:10.1214/10-BA524, for the implausibility.
        """
        residual, covariance = self.residual(z)
        misfit = float(residual @ np.linalg.solve(covariance, residual))
        return -0.5 * max(misfit - len(residual), 0.0) - SLIGHTLY * misfit

    def misfit(self, rows: Sequence[Array]) -> tuple[float, int]:
        """Chi-squared of the recordings against runs, without any emulator, and its size.

        Args:
            rows: for each recording values (m, p) of runs with parameters drawn from the posterior.

        Returns:
            Chi-squared, and the number of scores.
        """
        residuals, own = [], []
        for group, runs in zip(self.groups, rows, strict=True):
            emulator = group.emulator
            scores = ((runs - emulator.mean) / emulator.scale) @ group.basis.T
            mean, k = scores.mean(axis=0), len(emulator.components)
            covariance = self._known(group, mean[:k])
            if len(runs) > 1:
                covariance += np.diag(scores.var(axis=0, ddof=1)) / len(runs)
            residuals.append(group.scores - mean)
            own.append(covariance)
        residual = np.concatenate(residuals)
        return float(residual @ np.linalg.solve(self._together(own), residual)), len(residual)

    def _known(self, group: Group, mean: Array) -> Array:
        """Covariance (q, q) of one recording but for the emulator, at mean scores (k,)."""
        covariance = group.fixed.copy()
        if self.parts.clock:
            with_one = np.append(mean, 1.0)
            slope, moment = group.slope @ with_one, group.moment @ with_one
            covariance += group.start_sd**2 * np.outer(slope, slope)
            covariance += group.clock_error**2 * np.outer(moment, moment)
        return covariance

    def _together(self, own: Sequence[Array]) -> Array:
        """Covariance (K, K) of all recordings from that of each, and what these share."""
        factor = np.concatenate([group.shared for group in self.groups])
        total, at = factor @ factor.T, 0
        for covariance in own:
            k = len(covariance)
            total[at : at + k, at : at + k] += covariance
            at += k
        total[np.diag_indices(at)] *= 1.0 + LEAST
        return np.asarray(total)


def likelihood(
    observations: Sequence[Observed], emulators: Sequence[SeriesEmulator], parts: Parts = EVERY_PART
) -> Likelihood:
    """The likelihood of these recordings, each with the emulator of its conditions."""
    channels = sorted({block.channel for seen in observations for block in seen.blocks})
    pairs = zip(observations, emulators, strict=True)
    return Likelihood(tuple(_group(o, e, parts, channels) for o, e in pairs), parts)


def with_scores(its: Likelihood, scores: Array) -> Likelihood:
    """The same errors, for other scores (K,) of the recordings, such as drawn ones."""
    groups, at = [], 0
    for group in its.groups:
        k = len(group.scores)
        groups.append(replace(group, scores=frozen(scores[at : at + k])))
        at += k
    return replace(its, groups=tuple(groups))


def _group(
    seen: Observed, emulator: SeriesEmulator, parts: Parts, channels: Sequence[str]
) -> Group:
    slopes = _slopes(seen, emulator)
    basis = _basis(seen, emulator, slopes[-1:])
    k = len(emulator.components)
    waves = (ALLOWANCE if parts.allowance else 0.0) * _waves(seen, emulator, channels)
    own = basis @ (math.sqrt(1.0 - SHARED) * waves / emulator.scale[:, None])
    # Smaller than any error: keeps the covariance regular where nothing scatters.
    fixed = own @ own.T + 1e-8 * np.eye(len(basis))
    if parts.packing:
        fixed[:k, :k] += emulator.noise / seen.repeats
        beyond = emulator.beyond @ basis[k:].T
        fixed[k:, k:] += beyond.T @ beyond / len(beyond)
    if parts.measurement:
        at = basis / emulator.scale
        fixed += at @ seen.measured @ at.T
    if parts.constant:
        constant = basis @ (seen.constant / emulator.scale[:, None])
        fixed += constant @ constant.T
    back = (basis / emulator.scale).T  # (p, q)
    return Group(
        emulator, frozen(basis),
        frozen(basis @ ((seen.values - emulator.mean) / emulator.scale)), frozen(fixed),
        frozen(basis @ (math.sqrt(SHARED) * waves / emulator.scale[:, None])),
        frozen((slopes @ back).T), frozen((slopes * seen.times @ back).T),
        seen.clock_error, seen.start_sd,
    )  # fmt: skip


def _basis(seen: Observed, emulator: SeriesEmulator, slope: Array) -> Array:
    """Orthonormal rows (q, p): the components, then zero, scale, clock and slow waves beside them.

    All come from simulations: a direction made of the recording would find its own noise in it.

    Args:
        seen: the recording.
        emulator: of its conditions.
        slope: of the mean series in time (1, p).
    """
    starts = np.cumsum([0, *(block.size for block in seen.blocks)])
    place = np.arange(len(emulator.mean))
    scales = np.array(
        [
            np.where((place >= low) & (place < high), emulator.mean, 0.0)
            for low, high in itertools.pairwise(starts)
        ]
    )
    shapes = [slope, slope * seen.times, scales, _cosines(seen).T]
    beside = np.vstack(shapes) / emulator.scale
    size = np.sqrt(np.sum(beside**2, axis=1, keepdims=True))
    beside = beside / np.where(size > 0.0, size, 1.0)
    beside = beside - beside @ emulator.components.T @ emulator.components
    _, values, rows = np.linalg.svd(beside, full_matrices=False)
    return np.vstack([emulator.components, rows[values > INDEPENDENT]])


def _cosines(seen: Observed) -> Array:
    """Slow waves (p, WAVES a block) over the time of each block, with a root mean square of 1."""
    waves, at = np.zeros((len(seen.values), len(seen.blocks) * WAVES)), 0
    for number, block in enumerate(seen.blocks):
        phase = np.zeros(1) if block.times is None else block.times / seen.end
        basis = np.cos(np.pi * phase[:, None] * np.arange(WAVES))
        basis /= np.sqrt(np.sum(basis**2, axis=1, keepdims=True))
        waves[at : at + block.size, number * WAVES : (number + 1) * WAVES] = basis
        at += block.size
    return waves


def _waves(seen: Observed, emulator: SeriesEmulator, channels: Sequence[str]) -> Array:
    """The slow waves (p, r) by channel, with the scatter of one run as standard deviation."""
    scatter, cosines, at = emulator.scatter(), _cosines(seen), 0
    waves = np.zeros((len(scatter), len(channels) * WAVES))
    for number, block in enumerate(seen.blocks):
        here = slice(at, at + block.size)
        mean = float(np.sqrt(np.mean(scatter[here] ** 2)))
        first = channels.index(block.channel) * WAVES
        own = cosines[here, number * WAVES : (number + 1) * WAVES]
        waves[here, first : first + WAVES] = mean * own
        at += block.size
    return waves


def _slopes(seen: Observed, emulator: SeriesEmulator) -> Array:
    """Slope in time (k + 1, p) of each component and, last, of the mean."""
    rows = np.vstack([emulator.components * emulator.scale, emulator.mean])
    slopes, at = np.zeros_like(rows), 0
    for block in seen.blocks:
        here = slice(at, at + block.size)
        if block.times is not None:
            slopes[:, here] = np.gradient(rows[:, here], block.times, axis=1)
        at += block.size
    return slopes
