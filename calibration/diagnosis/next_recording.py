"""What to record next: the experiment and the channel that separate best what is still possible.

For each experiment of the library the hypotheses that are left predict all its channels, each with
what the recordings so far leave open. The separation of two hypotheses is the log evidence that one
recording more is expected to give for the true one:

    (m_i - m_j)' V^-1 (m_i - m_j) / 2,    V = packing + measurement + allowance + what is left open

weighted with how likely the two are.

Source: Chaloner & Verdinelli 1995, doi:10.1214/ss/1177009939.
"""

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calibration.diagnosis.compare import Compared
from calibration.diagnosis.weigh import Weighed
from calibration.parts import ALLOWANCE
from mfopt.arrays import AnyArray, Array
from mfopt.records.rig import TIME
from surrogates.effects import Runs
from surrogates.series import SeriesEmulator, fit_effect_series, with_effects

POINTS = 20  # in time of each series
COMPONENTS = 5
LEFT = 0.03  # probability of a hypothesis that is still possible
MOST_LEFT = 4
UNKNOWN_NOISE = 0.005  # [of the range] of a channel that nobody recorded


@dataclass(frozen=True, slots=True)
class Separation:
    """What one recording of an experiment is expected to tell."""

    experiment: str
    channels: tuple[str, ...]
    gain: float  # expected log evidence between two hypotheses that are left
    apart: tuple[str, str]  # the two that it separates best, of the likeliest


def still_possible(compared: Compared) -> list[tuple[Weighed, float]]:
    """The likeliest hypotheses about the physics, with their probabilities."""
    its = sorted(
        ((w, float(p)) for w, p in zip(compared.weighed, compared.probabilities, strict=True)
         if p >= LEFT and not w.which.other),
        key=lambda pair: -pair[1],
    )  # fmt: skip
    return its[:MOST_LEFT]


def separations(
    left: Sequence[tuple[Weighed, float]],
    experiment: str,
    runs: Runs,
    raw: Sequence[Mapping[str, AnyArray]],
    recorded: Mapping[str, float],
    transform: Callable[[Array], Array],
) -> list[Separation]:
    """What a recording of an experiment would tell: with the channels recorded so far, and more.

    Args:
        left: hypotheses that are still possible; measuring effects predict as if absent.
        experiment: what it is called.
        runs: of the library under its conditions.
        raw: what each run gave.
        recorded: errors of one recording, 1 sd, by channel that someone recorded.
        transform: from the cube of the priors (d, n) to that of the ranges.
    """
    channels = sorted(
        c for c in set.intersection(*({*r} for r in raw)) - {TIME} if np.size(raw[0][c]) > 1
    )
    if len(left) < 2 or not channels:
        return []
    end = min(float(r[TIME][-1]) for r in raw)
    times = np.linspace(0.0, end, POINTS)
    rows = np.array(
        [np.concatenate([np.interp(times, r[TIME], r[c]) for c in channels]) for r in raw]
    )
    emulator = fit_effect_series(runs, rows, [POINTS] * len(channels), COMPONENTS)
    noise = np.repeat(
        [
            recorded.get(c, UNKNOWN_NOISE * float(np.ptp(rows[:, i * POINTS : (i + 1) * POINTS])))
            for i, c in enumerate(channels)
        ],
        POINTS,
    )
    predicted = [(_predicted(emulator, w, transform), p, w.which.name) for w, p in left]
    wanted = [tuple(c for c in channels if c in recorded), *((c,) for c in channels)]
    return [
        _separation(experiment, chosen, channels, predicted, noise)
        for chosen in dict.fromkeys(w for w in wanted if w)
    ]


def _separation(
    experiment: str,
    chosen: tuple[str, ...],
    channels: Sequence[str],
    predicted: Sequence[tuple[tuple[Array, Array], float, str]],
    noise: Array,
) -> Separation:
    there = np.repeat([c in chosen for c in channels], POINTS)
    gain, best = 0.0, (0.0, predicted[0][2], predicted[1][2])
    total = sum(p * q for (_, p, _), (_, q, _) in itertools.combinations(predicted, 2))
    for (first, p, a), (second, q, b) in itertools.combinations(predicted, 2):
        apart = (first[0] - second[0])[there]
        covariance = (first[1] + second[1])[np.ix_(there, there)] / 2.0
        # Half of the errors are even over the recording, as those of zero and release.
        covariance += np.diag(noise[there] ** 2) / 2.0
        covariance += np.outer(noise[there], noise[there]) / 2.0
        its = float(apart @ np.linalg.solve(covariance, apart)) / 2.0
        gain += p * q / total * its
        best = max(best, (p * q * its, a, b))
    return Separation(experiment, chosen, gain, (best[1], best[2]))


def _predicted(
    emulator: SeriesEmulator, weighed: Weighed, transform: Callable[[Array], Array]
) -> tuple[Array, Array]:
    """Mean (p,) and covariance (p, p) of one run under a hypothesis."""
    which = weighed.which
    d = weighed.draws.shape[1] - which.added
    rig = [i for i, s in enumerate(which.suspects) if not s.measuring]
    numbers = [which.suspects[i].number for i in rig]
    strengths = which.strengths(weighed.draws[:, d:])[:, rig]
    points = np.hstack([transform(weighed.draws[:, :d].T).T, strengths])
    scores, doubt = with_effects(emulator, numbers).predict(points)
    packing = (1.0 + ALLOWANCE**2) * emulator.noise
    own = np.cov(scores.T).reshape(packing.shape) + np.diag(doubt.mean(axis=0)) + packing
    spread = emulator.components * emulator.scale
    beyond = emulator.beyond * emulator.scale
    covariance = spread.T @ own @ spread + np.diag(np.mean(beyond**2, axis=0))
    return emulator.series(scores.mean(axis=0)), np.asarray(covariance)
