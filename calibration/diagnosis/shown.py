"""Is the fit better on recordings that took no part? Errors of their prediction, with rivals.

    before      the best fit of nothing
    after       the likeliest effect, or effects
    decoy       the likeliest of all others: a library without the true effect must do worse
    discrepancy the best fit of nothing with a Gaussian process that all recordings share, which
                explains and names nothing (Kennedy and O'Hagan)

An error is the root mean square of recorded less predicted, over the standard deviation of the mean
of the repeats: about 1 where nothing is missing.

Source: Kennedy & O'Hagan 2001, doi:10.1111/1467-9868.00294.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.diagnosis.compare import Compared
from calibration.diagnosis.joint import NOTHING, OTHER, Joint
from calibration.diagnosis.weigh import Weighed
from calibration.diagnosis.where import in_points
from calibration.likelihood import Group
from calibration.observed import Observed
from mfopt.arrays import Array

DRAWS = 100


@dataclass(frozen=True, slots=True)
class HeldOut:
    """Errors of the prediction of one recording, or of all."""

    recording: str
    before: float
    after: float
    after_range: tuple[float, float]  # 90 % over what the recordings leave possible
    before_range: tuple[float, float]
    decoy: float
    decoy_name: str
    discrepancy: float


def held_out_errors(
    whole: Joint, observations: Sequence[Observed], fitted: int, compared: Compared
) -> tuple[HeldOut, ...]:
    """Errors of each recording after the first `fitted` ones of `whole`, and of all together."""
    if fitted == len(observations):
        return ()
    best = compared.likeliest
    named = {x.name for x in best.which.suspects}
    rest = (w for w in compared.explained if not named & {x.name for x in w.which.suspects})
    decoy = next(rest, compared.nothing)
    (other,) = (w for w in compared.weighed if w.which == OTHER)
    shared = _discrepancy(whole, fitted, other)
    errors = [
        _errors(whole, observations, fitted, scores)
        for scores in (
            whole.means(NOTHING, compared.nothing.best[None]),
            whole.means(best.which, best.best[None]),
            whole.means(decoy.which, decoy.best[None]),
            shared[None],
            whole.means(NOTHING, compared.nothing.draws[:DRAWS]),
            whole.means(best.which, best.draws[:DRAWS]),
        )
    ]
    names = [seen.name for seen in observations[fitted:]]
    if len(names) > 1:
        names.append("all")
    found = []
    for i, name in enumerate(names):
        before, after, its_decoy, black_box = (float(e[0, i]) for e in errors[:4])
        ranges = [tuple(map(float, np.quantile(e[:, i], (0.05, 0.95)))) for e in errors[4:]]
        found.append(
            HeldOut(
                name, before, after, (ranges[1][0], ranges[1][1]), (ranges[0][0], ranges[0][1]),
                its_decoy, decoy.which.name, black_box,
            )
        )  # fmt: skip
    return tuple(found)


def _discrepancy(whole: Joint, fitted: int, other: Weighed) -> Array:
    """Scores (K,) that the shared discrepancy predicts, learned from the fitted recordings."""
    point = other.best[None]
    mean, covariance = whole.means(OTHER, point)[0], whole.covariances(OTHER, point)[0]
    known = sum(len(g.scores) for g in whole.likelihood.groups[:fitted])
    inner = covariance[:known, :known]
    apart = np.linalg.solve(inner, whole.scores[:known] - mean[:known])
    return np.asarray(mean + covariance[:, :known] @ apart)


def _errors(whole: Joint, observations: Sequence[Observed], fitted: int, scores: Array) -> Array:
    """Errors (n, r) of predictions (n, K) for each recording held out; last, if several, of all."""
    split = np.cumsum([len(g.scores) for g in whole.likelihood.groups])[:-1]
    each = [
        _squares(group, seen, its, sd)
        for group, seen, its, sd in list(
            zip(
                whole.likelihood.groups,
                observations,
                np.split(scores, split, axis=1),
                whole.deviations,
                strict=True,
            )
        )[fitted:]
    ]
    if len(each) > 1:
        each.append(np.hstack(each))
    return np.array([np.sqrt(np.mean(squares, axis=1)) for squares in each]).T


def _squares(group: Group, seen: Observed, scores: Array, sd: Array) -> Array:
    """Squared errors (n, p) of a recording predicted with these scores (n, q), over `sd` (p,)."""
    row = group.emulator.mean + in_points(group, scores)
    return np.asarray(((seen.values - row) / sd) ** 2)
