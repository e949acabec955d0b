"""All hypotheses against one another: nothing, each effect, pairs of effects, and something else.

A hypothesis with something else beside an effect says that the effect leaves a part unexplained.
Pairs, and something else beside an effect, are weighed for the effects that explain most alone.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from calibration.diagnosis.joint import OTHER, Hypothesis, Joint, Suspect
from calibration.diagnosis.weigh import Weighed, weigh_nothing, weigh_one, weigh_pair
from mfopt.arrays import Array

# Prior probabilities of each kind of hypothesis.
NOTHING_MISSING, ONE, SOMETHING_ELSE, ONE_AND_ELSE = 0.4, 0.4, 0.1, 0.05
# The log evidence by which a pair must beat one effect, before both are as likely: without it
# spurious second effects come.
SECOND = 8.0
LEADERS = 5  # effects that are tried in pairs


@dataclass(frozen=True, slots=True, eq=False)
class Compared:
    """What each hypothesis explains, and how likely each is."""

    weighed: tuple[Weighed, ...]  # the first one is nothing
    probabilities: Array  # (n,)

    @property
    def nothing(self) -> Weighed:
        """The fit without any effect."""
        return self.weighed[0]

    @property
    def best(self) -> Weighed:
        """The likeliest hypothesis."""
        return self.weighed[int(np.argmax(self.probabilities))]

    @property
    def likeliest(self) -> Weighed:
        """The likeliest hypothesis of known effects alone; nothing if there is none."""
        return next(iter(self.explained), self.nothing)

    @property
    def explained(self) -> list[Weighed]:
        """Hypotheses of known effects alone, the likeliest first."""
        order = np.argsort(-self.probabilities, kind="stable")
        its = (self.weighed[i] for i in order)
        return [w for w in its if w.which.suspects and not w.which.other]

    def probability(self, holds: Callable[[Hypothesis], bool]) -> float:
        """Probability of all hypotheses of which something holds."""
        its = [p for w, p in zip(self.weighed, self.probabilities, strict=True) if holds(w.which)]
        return float(np.sum(its))

    def of(self, name: str) -> float:
        """Probability that an effect is there, alone or not."""
        return self.probability(lambda which: name in {s.name for s in which.suspects})


def compare(joint: Joint, suspects: Sequence[Suspect], dimensions: int, seed: int) -> Compared:
    """Weigh all hypotheses about recordings with so many base parameters."""
    nothing = weigh_nothing(joint, dimensions, seed)
    singles = [weigh_one(joint, Hypothesis((s,)), nothing.best, seed) for s in suspects]
    leaders = sorted(singles, key=lambda w: -w.log_evidence)[:LEADERS]
    pairs = [
        weigh_pair(joint, first, second.which.suspects[0], seed)
        for i, first in enumerate(leaders)
        for second in leaders[i + 1 :]
    ]
    beside = [weigh_one(joint, Hypothesis(w.which.suspects, True), w.best, seed) for w in leaders]
    weighed = (nothing, *singles, weigh_one(joint, OTHER, nothing.best, seed), *pairs, *beside)
    logs = np.array([w.log_evidence + _log_prior(w.which, len(suspects)) for w in weighed])
    return Compared(weighed, np.exp(logs - logsumexp(logs)))


def _log_prior(which: Hypothesis, suspects: int) -> float:
    """Log prior probability of a hypothesis, among those with so many suspects."""
    if not which.suspects:
        return math.log(SOMETHING_ELSE if which.other else NOTHING_MISSING)
    if which.other:
        return math.log(ONE_AND_ELSE / suspects)
    return math.log(ONE / suspects) - SECOND * (len(which.suspects) - 1)
