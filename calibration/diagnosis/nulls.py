"""Is there a mismatch at all? One p-value, from recordings drawn as if nothing were missing.

Two statistics look for it: how much likelier the best suspect makes the recordings, and how much
likelier something makes them that no suspect is. The smaller of their two p-values counts; how
small it is without any mismatch is known from drawn recordings.

The drawn recordings are refitted with simulations that are linear in the base parameters. Where
the p-value is close to the level, some of them are refitted as the recordings were.

Source: Tippett 1931 for the smallest p-value; Davison & Hinkley 1997, ch. 4.
"""

from dataclasses import dataclass

import numpy as np

from calibration.diagnosis.climb import climb
from calibration.diagnosis.compare import Compared
from calibration.diagnosis.joint import NOTHING, OTHER, Joint
from calibration.diagnosis.linear import Around
from mfopt.arrays import Array

DRAWN = 2000
REFITTED = 200
CLOSE = (0.005, 0.2)  # p-values between which draws are refitted


@dataclass(frozen=True, slots=True)
class Mismatch:
    """What the test found."""

    probability: float  # of a mismatch at least as clear where nothing is missing
    gain: float  # of the best suspect, in log likelihood
    gain_at_5: float  # which the best suspect reaches in 5 % of the draws
    refitted: int  # draws that were refitted in full


def mismatch_in(joint: Joint, its: Around, compared: Compared, seed: int) -> Mismatch:
    """Test recordings whose hypotheses were compared."""
    rng = np.random.default_rng(seed)
    drawn = its.mean + rng.standard_normal((DRAWN, len(its.mean))) @ its.factor.T
    suspects, other = its.gains(drawn)
    best = suspects.max(axis=1)
    seen = _gains(compared)
    found = _probability(seen, best, other)
    refitted = 0
    if CLOSE[0] < found < CLOSE[1]:
        refitted = REFITTED
        most = np.argmax(suspects[:REFITTED], axis=1)
        best = _refitted(joint, its, drawn[:REFITTED], most, compared.nothing.best)
        found = _probability(seen, best, other[:REFITTED])
    return Mismatch(found, seen[0], float(np.quantile(best, 0.95)), refitted)


def _gains(compared: Compared) -> tuple[float, float]:
    """Log likelihood ratios by the best suspect, and by what no suspect is."""
    nothing = compared.nothing.log_likelihood
    single = [w for w in compared.weighed if len(w.which.suspects) == 1 and not w.which.other]
    (other,) = (w for w in compared.weighed if w.which == OTHER)
    best = max((w.log_likelihood for w in single), default=nothing)
    return best - nothing, other.log_likelihood - nothing


def _refitted(joint: Joint, its: Around, drawn: Array, most: Array, best: Array) -> Array:
    """Gains (n,) of draws (n, K) by the suspects (n,) that explain most of each, refitted."""
    base = np.tile(best, (len(drawn), 1))
    none = climb(joint, NOTHING, drawn, base).log_likelihoods
    gains = np.empty(len(drawn))
    for number, which in enumerate(its.single):
        mine = np.flatnonzero(most == number)
        if not len(mine):
            continue
        strength = its.strengths(number, drawn[mine])
        start = np.column_stack([base[mine], strength])
        gains[mine] = climb(joint, which, drawn[mine], start).log_likelihoods - none[mine]
    return gains


def _probability(seen: tuple[float, float], best: Array, other: Array) -> float:
    """Share of draws whose smaller p-value is at most that of the recordings."""
    tails = [_tails(np.append(s, d)) for s, d in zip(seen, (best, other), strict=True)]
    smaller = np.minimum(*tails)
    return float(np.mean(smaller <= smaller[0]))  # the recordings are among them


def _tails(values: Array) -> Array:
    """For each value (n,) the share of all that are at least as large."""
    below = np.searchsorted(np.sort(values), values, side="left")
    return np.asarray((len(values) - below) / len(values))
