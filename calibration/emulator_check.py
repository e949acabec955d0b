"""Check of the emulators against runs that they did not see.

Each run of the fit is left out and predicted from all others, in closed form. The runs of the
posterior are predicted too: they were made after the fit. Scores of run less prediction, over their
standard deviations (doubt of the emulator and packing noise), are the z of the check. Their mean
square s is 1 if the emulator knows its errors. By chance it follows Fisher's F, a ratio of two
chi-squared. With R the correlations of the N errors of m runs, the degrees of freedom are

    f = N^2 / sum R^2,    g = (n - fitted values) f / m

g are those of the noise, which is found from the n runs of the fit; f / m scores count as
independent.

Source: Bastos & O'Hagan 2009, doi:10.1198/TECH.2009.08019; for f Satterthwaite 1946,
doi:10.2307/3002019.
"""

from collections.abc import Sequence

import numpy as np
from scipy.stats import f as fisher
from scipy.stats import norm

from calibration.observed import Observed
from calibration.posterior import LEVEL, to_unit
from calibration.recordings.case import Case
from calibration.runs import finished
from mfopt.arrays import Array
from mfopt.records.calibration import EmulatorCheck
from mfopt.records.evaluation import Evaluation
from surrogates.scores import FITTED
from surrogates.series import SeriesEmulator

BY_CHANCE = 0.01  # probability that one of the checks of right emulators warns


def check_emulators(
    case: Case,
    observations: Sequence[Observed],
    emulators: Sequence[SeriesEmulator],
    made: Sequence[Evaluation],
) -> tuple[EmulatorCheck, ...]:
    """Two checks of the emulator of each fitted recording: runs left out, and fresh runs.

    Args:
        case: with the recordings.
        observations: of the fitted recordings, in that order.
        emulators: of the fitted recordings.
        made: runs of the posterior, which the emulators did not see.
    """
    chance = BY_CHANCE / (2 * len(emulators))
    checks = []
    for recording, seen, emulator in zip(case.fitted, observations, emulators, strict=True):
        fresh = finished(made, recording)
        x = np.array([e.candidate.x for e in fresh])
        rows = np.array([seen.row(e.outcome.raw) for e in fresh])
        z, noise = to_unit(case.parameters, x), _measured(seen, emulator)
        checks.append(check_left_out(seen.name, emulator, chance, noise))
        checks.append(check_fresh(seen.name, emulator, z, rows, chance, noise))
    return tuple(checks)


def _measured(seen: Observed, emulator: SeriesEmulator) -> float:
    """Mean variance of what is measured, in units of the emulator's scale."""
    variance = np.diag(seen.measured) + np.sum(seen.constant**2, axis=1)
    return float(np.mean(variance / emulator.scale**2))


def check_left_out(
    name: str, emulator: SeriesEmulator, chance: float, noise: float
) -> EmulatorCheck:
    """Each run of the fit, predicted from all others.

    Args:
        name: of the recording.
        emulator: of the recording's conditions.
        chance: probability of a false alarm.
        noise: mean variance of what is measured, in units of the emulator's scale.
    """
    errors, covariance = emulator.scores.left_out_errors()
    # The likelihood takes the noise of replicates where that is larger.
    more = np.diag(emulator.noise) - emulator.scores.noise
    covariance = covariance + more[:, None, None] * np.eye(len(errors))
    beyond = emulator.beyond
    return _check(name, emulator, errors, covariance, beyond, chance, noise, fresh=False)


def check_fresh(
    name: str, emulator: SeriesEmulator, z: Array, rows: Array, chance: float, noise: float
) -> EmulatorCheck:
    """Runs (m, p) at parameters (m, d) in the unit cube, predicted."""
    scores = emulator.project(rows)
    errors = scores - emulator.predict(z)[0]
    packing = np.diag(emulator.noise)[:, None, None] * np.eye(len(z))
    covariance = emulator.scores.covariance(z) + packing
    beyond = (rows - emulator.series(scores)) / emulator.scale
    return _check(name, emulator, errors, covariance, beyond, chance, noise, fresh=True)


def _check(
    name: str,
    emulator: SeriesEmulator,
    errors: Array,
    covariance: Array,
    beyond: Array,
    chance: float,
    noise: float,
    *,
    fresh: bool,
) -> EmulatorCheck:
    """From errors of scores (n, k), with covariance (k, n, n), and what is beyond these (n, p)."""
    variance = np.einsum("knn->nk", covariance)
    z = errors / np.sqrt(variance)
    freedom = _freedom(covariance, _between(emulator))
    runs, parameters = emulator.scores.z.shape
    of_noise = max(runs - parameters - FITTED, 1) * freedom / len(errors)
    blur = np.mean((emulator.scatter() / emulator.scale) ** 2) + noise
    away = np.mean((errors @ emulator.components + beyond) ** 2)
    return EmulatorCheck(
        recording=name,
        fresh=fresh,
        runs=len(errors),
        held=float(np.mean(np.abs(z) <= norm.ppf(0.5 + LEVEL / 2.0))),
        squared=float(np.mean(z**2)),
        by_chance=float(fisher.isf(chance, freedom, of_noise)),
        error=float(np.sqrt(away / blur)) if blur > 0.0 else 0.0,
    )


def _between(emulator: SeriesEmulator) -> Array:
    """Correlations (k, k) between the scores of one run, less their predictions."""
    errors, covariance = emulator.scores.left_out_errors()
    z = errors / np.sqrt(np.einsum("knn->nk", covariance))
    size = np.sqrt(np.sum(z**2, axis=0))
    return np.asarray(z.T @ z / np.outer(size, size))


def _freedom(covariance: Array, between: Array) -> float:
    """Degrees of freedom of errors (n, k) with covariance (k, n, n), and correlations (k, k)."""
    variance = np.einsum("knn->kn", covariance)
    squares = covariance**2 / (variance[:, :, None] * variance[:, None, :])
    within = np.sum(np.minimum(squares, 1.0))  # rounding, where hardly any variance is left
    k, n = variance.shape
    return float(variance.size**2 / (within + n * (np.sum(between**2) - k)))
