"""By how much zero, scale and clock of each recording were off, from what the fit says of them.

These errors are Gaussian and known by their standard deviations. Given the recordings, error j with
the direction f_j in scores, the residual r and its covariance C has

    mean f_j C^-1 r and variance 1 - f_j C^-1 f_j, in standard deviations of the stated error.

Both are averaged over draws of the posterior.
"""

from collections.abc import Mapping

import numpy as np
from scipy.linalg import block_diag

from calibration.campaign import Fitted
from calibration.observed import Observed
from calibration.posterior import to_unit
from calibration.recordings.case import Case
from mfopt.arrays import Array
from mfopt.records.calibration import Offset
from mfopt.records.rig import Channel

AVERAGED = 50  # draws
EARLY = -1.0  # a series that was recorded too early has times that are too small


def offsets(fitted: Fitted, case: Case, channels: Mapping[str, Channel]) -> tuple[Offset, ...]:
    """The errors that the case states to be possible, recorded less true."""
    stated = [error for seen in fitted.observations for error in _stated(seen, case, channels)]
    if not stated:
        return ()
    draws = to_unit(case.parameters, fitted.posterior.draws)
    each = np.array([_given(fitted, z) for z in draws[:: max(1, len(draws) // AVERAGED)]])
    mean = each[:, 0].mean(axis=0)
    sd = np.sqrt(each[:, 1].mean(axis=0) + each[:, 0].var(axis=0))
    return tuple(
        Offset(recording, error, unit, size, float(size * at), float(size * wide))
        for (recording, error, unit, size), at, wide in zip(stated, mean, sd, strict=True)
    )


def _stated(
    seen: Observed, case: Case, channels: Mapping[str, Channel]
) -> list[tuple[str, str, str, float]]:
    """Recording, error, unit and 1 sd of each error, in the order of `_directions`."""
    found = []
    for channel, values in seen.split(seen.values).items():
        known, unit = case.measurement.of(channel), channels[channel].unit
        found += [(f"zero of {channel}", unit, known.offset)] if known.offset else []
        found += [(f"scale of {channel}", "-", known.scale)] if known.scale * values.any() else []
    found += [("start of the time", "s", seen.start_sd)] if seen.start_sd else []
    found += [("speed of the clock", "-", seen.clock_error)] if seen.clock_error else []
    return [(seen.name, *error) for error in found]


def _given(fitted: Fitted, z: Array) -> Array:
    """Mean and variance (2, n) of the errors in stated standard deviations, at z (d,)."""
    residual, covariance = fitted.likelihood.residual(z)
    columns = _directions(fitted, z)
    weights = np.linalg.solve(covariance, columns)
    return np.array([weights.T @ residual, 1.0 - np.sum(weights * columns, axis=0)])


def _directions(fitted: Fitted, z: Array) -> Array:
    """What one standard deviation of each error does to the scores (K, n) of all recordings."""
    own = []
    for group, seen in zip(fitted.likelihood.groups, fitted.observations, strict=True):
        mean = np.append(group.emulator.predict(z[None])[0][0], 1.0)
        constant = group.basis @ (seen.constant / group.emulator.scale[:, None])
        start = EARLY * group.start_sd * (group.slope @ mean)[:, None]
        clock = EARLY * group.clock_error * (group.moment @ mean)[:, None]
        own.append(
            np.hstack(
                [
                    constant,
                    *([start] if seen.start_sd else []),
                    *([clock] if seen.clock_error else []),
                ]
            )
        )
    return np.asarray(block_diag(*own))
