"""What is said of recordings: nothing is missing, a name, a set, a main part, something unknown.

A name needs a probability of 0.8, a fit that leaves nothing unexplained, and no recording that
speaks against it: left out of the fit, each must be predicted about as well with the effect as
without. It must also beat clearly all effects that are of one class with it; where no second
recording can confirm it, the whole class is named. What fails this becomes a set of at most three,
or stays unknown. Where no known effect fits, those that explain most of it are told.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.stats import chi2

from calibration.diagnosis.compare import Compared
from calibration.diagnosis.joint import NOTHING, Hypothesis, Joint, Suspect
from calibration.diagnosis.nulls import Mismatch
from calibration.diagnosis.weigh import weigh_nothing, weigh_one
from mfopt.names import listed

ALARM = 0.05  # p-value of a mismatch
NAMED = 0.8  # probability of a name
SET = 0.9  # of a set
MOST = 3  # effects in a set
UNEXPLAINED = 1e-3  # p-value of the misfit that is left
CLEARLY = 8.0  # log evidence by which an effect must beat another one of its class
AGAINST = -3.0  # log predictive density with the effect less without, of a vote against it

# To be told as a part: share of the misfit beyond chance that an effect takes away, and what it
# leaves over what the best one leaves.
MAINLY, NEARLY = 0.9, 2.0

Kind = Literal["nothing", "named", "set", "partly", "unknown"]


@dataclass(frozen=True, slots=True)
class Vote:
    """How well a recording is predicted from the others with an effect."""

    effect: str
    recording: str
    gain: float  # log predictive density with the effect less that without

    @property
    def against(self) -> bool:
        """Whether the recording speaks against the effect."""
        return self.gain < AGAINST


@dataclass(frozen=True, slots=True)
class Verdict:
    """What is said, and why not more."""

    kind: Kind
    effects: tuple[str, ...]  # the names, or those of the set
    probability: float  # of what is said
    unexplained: float  # p-value of the misfit that the likeliest hypothesis leaves
    votes: tuple[Vote, ...]
    why: str  # no name is given; empty if one is
    explained: float | None = None  # share of the misfit beyond chance, of effects that are a part


def judged(
    joint: Joint,
    recordings: Sequence[str],
    compared: Compared,
    test: Mismatch,
    classes: Sequence[Sequence[str]],
    seed: int,
) -> Verdict:
    """Judge recordings.

    Args:
        joint: all of them.
        recordings: their names, in that order.
        compared: all hypotheses.
        test: whether there is a mismatch.
        classes: effects that the recordings cannot tell apart.
        seed: of the draws.
    """
    best = compared.best
    freedom = max(1, len(joint.scores) - len(best.best))
    left = float(chi2.sf(best.misfit, freedom))
    if test.probability > ALARM:
        p = compared.probability(lambda which: which == NOTHING)
        return Verdict("nothing", (), p, left, (), "")
    else_p = compared.probability(lambda which: which.other)
    likely = sorted(
        {s.name: s for w in compared.weighed for s in w.which.suspects}.values(),
        key=lambda s: -compared.of(s.name),
    )
    if left < UNEXPLAINED or else_p > 1.0 - NAMED:
        why = (
            "every known effect leaves a part unexplained"
            if left < UNEXPLAINED
            else f"something that is no known effect has a probability of {else_p:.2f}"
        )
        nearly = NEARLY if len(recordings) > 1 else math.inf
        return _part(compared, len(joint.scores), else_p, left, why, nearly)
    named = [s for s in likely if compared.of(s.name) >= NAMED]
    votes = tuple(v for s in named for v in voted(joint, recordings, s, seed))
    names = tuple(s.name for s in named)
    doubt = _doubt(recordings, votes)
    if len(named) == 1 and (mates := mates_of(compared, names[0], classes, clear=not doubt)):
        names = (names[0], *mates)
        p = compared.probability(lambda w: any(s.name in names for s in w.suspects))
        why = doubt or "these recordings hardly tell them apart"
        return Verdict("set", names, p, left, votes, why)
    if named and not any(v.against for v in votes):
        return Verdict("named", names, min(map(compared.of, names)), left, votes, "")
    return _set(compared, likely, left, votes, doubt)


def _part(
    compared: Compared, scores: int, else_p: float, left: float, why: str, nearly: float
) -> Verdict:
    """Effects each of which explains nearly all of a mismatch that no known effect explains.

    Args:
        compared: all hypotheses.
        scores: how many the recordings have.
        else_p: probability of something that is no known effect.
        left: p-value of the misfit that the likeliest hypothesis leaves.
        why: no effect is named.
        nearly: times what the best effect leaves, up to which another one is told beside it.
    """
    chance = scores - len(compared.nothing.best)
    beyond = {
        w.which.suspects[0].name: max(w.misfit - chance, 1.0)
        for w in compared.explained
        if len(w.which.suspects) == 1
    }
    whole, best = compared.nothing.misfit - chance, min(beyond.values(), default=1.0)
    names = [
        name
        for name in sorted(beyond, key=lambda n: beyond[n])
        if beyond[name] <= min((1.0 - MAINLY) * whole, nearly * best)
    ]
    if not 1 <= len(names) <= MOST:
        return Verdict("unknown", (), else_p, left, (), why)
    p = compared.probability(lambda w: any(s.name in names for s in w.suspects))
    return Verdict("partly", tuple(names), p, left, (), why, 1.0 - beyond[names[0]] / whole)


def _doubt(recordings: Sequence[str], votes: Sequence[Vote]) -> str:
    """Why the recordings do not confirm the likeliest effect; empty if they do."""
    if len(recordings) == 1:
        return "there is one experiment only, so none can confirm the likeliest of them"
    against = sorted({v.recording for v in votes if v.against})
    return f"{listed(against)} speaks against the likeliest" if against else ""


def mates_of(
    compared: Compared, name: str, classes: Sequence[Sequence[str]], *, clear: bool
) -> tuple[str, ...]:
    """Effects of one class with an effect, the likeliest first.

    Where the recordings confirm it, those that it clearly beats are left out.
    """
    alone = {
        w.which.suspects[0].name: w.log_evidence
        for w in compared.weighed
        if len(w.which.suspects) == 1 and not w.which.other
    }
    mates = {other for its in classes if name in its for other in its} - {name}
    left = [m for m in mates if not clear or alone[name] - alone[m] < CLEARLY]
    return tuple(sorted(left, key=lambda mate: (-alone[mate], mate))[: MOST - 1])


def _set(
    compared: Compared, likely: Sequence[Suspect], left: float, votes: tuple[Vote, ...], doubt: str
) -> Verdict:
    """The smallest set that is likely enough, or none."""
    for size in range(2, MOST + 1):
        names = tuple(s.name for s in likely[:size])
        p = compared.probability(lambda w, n=names: any(s.name in n for s in w.suspects))  # type: ignore[misc]
        if p >= SET:
            return Verdict(
                "set", names, p, left, votes, doubt or "the recordings do not tell them apart"
            )
    return Verdict(
        "unknown", (), float(np.max(compared.probabilities)), left, votes,
        doubt or f"more than {MOST} effects are possible",
    )  # fmt: skip


def voted(joint: Joint, recordings: Sequence[str], effect: Suspect, seed: int) -> list[Vote]:
    """The vote of each recording, predicted from all others; none where there is one only."""
    which = Hypothesis((effect,))

    def evidences(its: Joint) -> float:
        dimensions = its.likelihood.groups[0].emulator.scores.z.shape[1]
        nothing = weigh_nothing(its, dimensions, seed)
        return weigh_one(its, which, nothing.best, seed).log_evidence - nothing.log_evidence

    count = len(recordings)
    if count < 2:
        return []
    every = evidences(joint)
    return [
        Vote(effect.name, name, every - evidences(joint.of([i for i in range(count) if i != out])))
        for out, name in enumerate(recordings)
    ]
