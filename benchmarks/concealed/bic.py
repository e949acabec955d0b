"""What a plain choice by BIC names: a baseline of the diagnosis.

Each effect is fitted alone by least squares, as if the errors of all n points were independent:

    chi2 = sum ((recorded - emulated) / sd)^2,    sd^2 = measurement noise + packing / repeats
    BIC = chi2 + k log n

with k fitted parameters. Nothing is allowed for beside noise and packing.

Source: Schwarz 1978, doi:10.1214/aos/1176344136.
"""

from collections.abc import Callable, Sequence

import numpy as np
from scipy.optimize import least_squares

from benchmarks.concealed.distance import rows_at
from calibration.diagnosis.joint import NOTHING, Hypothesis, Joint, Suspect
from calibration.observed import Observed
from mfopt.arrays import Array

STRONG = 6.0  # by which an effect must beat nothing: Kass & Raftery 1995, JASA 90:773
STARTS = (0.25, 0.8)  # of each coordinate of the cube; signed strengths lie on both sides of 0
EVALUATIONS = 15  # at most, of each fit
STEP = 1e-3  # of the unit cube, of finite differences
SETTLED = 1e-4  # relative change of chi-squared at which a fit ends


def chosen(
    joint: Joint, observations: Sequence[Observed], suspects: Sequence[Suspect], dimensions: int
) -> str:
    """The effect with the lowest BIC, or `nothing` if none is clearly better.

    Args:
        joint: the fitted recordings.
        observations: of each of them.
        suspects: all effects that may be there.
        dimensions: how many base parameters there are.
    """
    values = np.concatenate([seen.values for seen in observations])
    sd = deviations(joint, observations)

    plain, base = _fitted(
        joint, NOTHING, values, sd, [np.full(dimensions, start) for start in STARTS]
    )
    starts = [np.append(base, start) for start in STARTS]
    found = {s.name: _fitted(joint, Hypothesis((s,)), values, sd, starts)[0] for s in suspects}
    name = min(found, key=lambda n: found[n], default="nothing")
    return name if found and found[name] < plain - STRONG else "nothing"


def _fitted(
    joint: Joint, which: Hypothesis, values: Array, sd: Array, starts: Sequence[Array]
) -> tuple[float, Array]:
    """BIC of a hypothesis and its best point (D,), for values (n,) with errors `sd` (n,)."""

    def residuals(points: Array) -> Array:
        """Of points (m, D): (m, n)."""
        return np.asarray((np.hstack(rows_at(joint, which, points)) - values) / sd)

    chi2, best = min((_least_squares(residuals, s) for s in starts), key=lambda made: made[0])
    return chi2 + len(best) * float(np.log(len(values))), best


def _least_squares(residuals: Callable[[Array], Array], start: Array) -> tuple[float, Array]:
    """Least chi-squared of residuals in the unit cube, from a start (D,), and its point."""

    def slopes(u: Array) -> Array:
        """Derivatives (n, D), by steps towards the middle of the cube."""
        steps = np.where(u > 0.5, -STEP, STEP)
        rows = residuals(np.vstack([u, u + np.diag(steps)]))
        return np.asarray((rows[1:] - rows[0]).T / steps)

    found = least_squares(
        lambda u: residuals(u[None])[0], start, slopes, (0.0, 1.0), ftol=SETTLED,
        max_nfev=EVALUATIONS,
    )  # fmt: skip
    return 2.0 * float(found.cost), np.asarray(found.x)


def deviations(joint: Joint, observations: Sequence[Observed]) -> Array:
    """Standard deviations (n,) of all points by measurement noise and packing."""
    pairs = zip(joint.likelihood.groups, observations, strict=True)
    variances = [
        np.diag(seen.measured) + group.emulator.scatter() ** 2 / seen.repeats
        for group, seen in pairs
    ]
    return np.sqrt(np.concatenate(variances))
