"""How likely recordings are at given parameters, with every error that is known of.

The scores of all recordings together are one Gaussian vector. Its covariance adds, by recording,

    packing / repeats + measurement noise / repeats + doubt of the emulator
    + zero and scale of each channel + clock (slope of the series times its error)
    + allowance for the difference between engine and reality, partly shared by all recordings.

Each part can be left out (`Parts`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from calibration.observed import Observed
from mfopt.arrays import Array, frozen
from mfopt.errors import ConfigError
from surrogates.series import SeriesEmulator

# The engine `numba` differs from YADE by up to 0.5 of the scatter of one run: `docs/engine`.
ALLOWANCE = 0.4  # [scatters of one run]
SHARED = 0.5  # of its variance, by all recordings
WAVES = 8  # cosines over the run: the shortest lasts a quarter of it
LEAST = 1e-9  # [of a score's variance] added to the diagonal


@dataclass(frozen=True, slots=True)
class Parts:
    """Which errors count."""

    packing: bool = True
    measurement: bool = True
    emulator: bool = True
    constant: bool = True  # zero and scale
    clock: bool = True
    allowance: float = ALLOWANCE  # [scatters of one run]; 0: none


EVERY_PART = Parts()


def parts_without(names: Sequence[str]) -> Parts:
    """Every error but these.

    Raises:
        ConfigError: if there is no such error.
    """
    known = [f.name for f in fields(Parts)]
    for name in names:
        if name not in known:
            raise ConfigError(f"there is no error {name!r}; choose from {', '.join(known)}")
    kept = {name: name not in names for name in known}
    allowance = ALLOWANCE if kept.pop("allowance") else 0.0
    return Parts(**kept, allowance=allowance)


@dataclass(frozen=True, slots=True, eq=False)
class _Group:
    """One recording, in scores."""

    emulator: SeriesEmulator
    scores: Array  # (k,) of the recording
    fixed: Array  # (k, k) covariance that does not depend on the parameters
    shared: Array  # (k, r) factor of what all recordings have in common
    slope: Array  # (k, k + 1): of the series in time, from the scores and 1
    moment: Array  # (k, k + 1): the same times the time
    clock_error: float
    start_sd: float


@dataclass(frozen=True, slots=True, eq=False)
class Likelihood:
    """Log density of all recordings at parameters in the unit cube."""

    groups: tuple[_Group, ...]
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
        residuals, own, shared = [], [], []
        for group in self.groups:
            mean, variance = (a[0] for a in group.emulator.predict(z[None]))
            covariance = group.fixed + (np.diag(variance) if self.parts.emulator else 0.0)
            if self.parts.clock:
                with_one = np.append(mean, 1.0)
                slope, moment = group.slope @ with_one, group.moment @ with_one
                covariance = covariance + group.start_sd**2 * np.outer(slope, slope)
                covariance += group.clock_error**2 * np.outer(moment, moment)
            residuals.append(group.scores - mean)
            own.append(covariance)
            shared.append(group.shared)
        factor = np.concatenate(shared)
        total, at = factor @ factor.T, 0
        for covariance in own:
            k = len(covariance)
            total[at : at + k, at : at + k] += covariance
            at += k
        total[np.diag_indices(at)] *= 1.0 + LEAST
        return np.concatenate(residuals), total


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
) -> _Group:
    waves = parts.allowance * _waves(seen, emulator, channels)
    own, shared = math.sqrt(1.0 - SHARED) * waves, math.sqrt(SHARED) * waves
    k = len(emulator.components)
    fixed = emulator.project_covariance(own, own, emulator)
    # Smaller than any error: keeps the covariance regular where nothing scatters.
    fixed += 1e-8 * np.eye(k)
    if parts.packing:
        fixed += emulator.noise / seen.repeats
    if parts.measurement:
        at = emulator.components / emulator.scale
        fixed += at @ seen.measured @ at.T
    if parts.constant:
        fixed += emulator.project_covariance(seen.constant, seen.constant, emulator)
    slope, moment = _slopes(seen, emulator)
    return _Group(
        emulator, frozen(emulator.project(seen.values)), frozen(fixed),
        frozen(emulator.components @ (shared / emulator.scale[:, None])),
        frozen(slope), frozen(moment), seen.clock_error, seen.start_sd,
    )  # fmt: skip


def _waves(seen: Observed, emulator: SeriesEmulator, channels: Sequence[str]) -> Array:
    """Slow waves (p, r) of each channel, with the scatter of one run as standard deviation."""
    scatter, at = emulator.scatter(), 0
    waves = np.zeros((len(scatter), len(channels) * WAVES))
    for block in seen.blocks:
        here = slice(at, at + block.size)
        phase = np.zeros(1) if block.times is None else block.times / seen.end
        basis = np.cos(np.pi * phase[:, None] * np.arange(WAVES))
        basis /= np.sqrt(np.sum(basis**2, axis=1, keepdims=True))
        first = channels.index(block.channel) * WAVES
        mean = float(np.sqrt(np.mean(scatter[here] ** 2)))
        waves[here, first : first + WAVES] = mean * basis
        at += block.size
    return waves


def _slopes(seen: Observed, emulator: SeriesEmulator) -> tuple[Array, Array]:
    """From scores and 1 to the scores of the slope in time (k, k + 1), and of time times slope."""
    rows = np.vstack([emulator.components * emulator.scale, emulator.mean])  # (k + 1, p)
    slopes, at = np.zeros_like(rows), 0
    for block in seen.blocks:
        here = slice(at, at + block.size)
        if block.times is not None:
            slopes[:, here] = np.gradient(rows[:, here], block.times, axis=1)
        at += block.size
    back = (emulator.components / emulator.scale).T  # (p, k)
    return (slopes @ back).T, ((slopes * seen.times) @ back).T
