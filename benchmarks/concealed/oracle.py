"""The held-out error of an oracle: a fit that knows which effects are there, and tries no other."""

from collections.abc import Sequence

import numpy as np

from calibration.diagnosis.compare import Compared
from calibration.diagnosis.joint import OTHER, Hypothesis, Joint, Suspect
from calibration.diagnosis.shown import held_out_errors
from calibration.diagnosis.weigh import Weighed, weigh_nothing, weigh_one, weigh_pair
from calibration.observed import Observed
from mfopt.arrays import Array


def oracle_error(
    whole: Joint,
    observations: Sequence[Observed],
    fitted: int,
    effects: Sequence[Suspect],
    dimensions: int,
    seed: int = 1,
) -> float:
    """Error of the recordings after the first `fitted` ones, as `calibration.diagnosis.shown`.

    Args:
        whole: all recordings.
        observations: of each of them.
        fitted: how many are fitted.
        effects: one or two that are there.
        dimensions: how many base parameters there are.
        seed: of the fits.
    """
    joint = whole.of(range(fitted))
    nothing = weigh_nothing(joint, dimensions, seed)
    true = knowing(joint, effects, nothing.best, seed)
    weighed = (nothing, true, weigh_one(joint, OTHER, nothing.best, seed))
    certain = Compared(weighed, np.array([0.0, 1.0, 0.0]))
    return held_out_errors(whole, observations, fitted, certain)[-1].after


def knowing(joint: Joint, effects: Sequence[Suspect], base: Array, seed: int) -> Weighed:
    """The hypothesis of one or two effects; `base` (d,) is where the fit of nothing is best."""
    alone = [weigh_one(joint, Hypothesis((effect,)), base, seed) for effect in effects]
    first, *others = sorted(alone, key=lambda w: -w.log_evidence)
    if not others:
        return first
    return weigh_pair(joint, first, others[0].which.suspects[0], seed)
