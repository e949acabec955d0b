"""Further runs for one case, where the emulators are the largest error.

A library spreads its runs over all ranges. Recordings that are far more exact than it ask for runs
nearby: half of them without an effect, half with the effects that explain most, drawn from what
each leaves possible and somewhat wider.
"""

from collections.abc import Sequence

import numpy as np

from calibration.diagnosis.compare import Compared
from calibration.diagnosis.joint import NOTHING, Joint
from calibration.diagnosis.library import Library
from calibration.diagnosis.weigh import Weighed
from calibration.likelihood import Group
from mfopt.arrays import Array, frozen
from mfopt.records.evaluation import Candidate
from surrogates.series import with_effects

ROUNDS = 3
EACH = 40  # runs of a recording in a round
LEADERS = 3  # effects that they have
WIDER = 1.5  # times as wide as what is possible
ROUGH = 1.0  # variance of the emulator over all other errors, from which runs are made
FIRST_SEED = 1_000_000  # packings that the library does not have


def refined(
    library: Library,
    joint: Joint,
    names: Sequence[str],
    compared: Compared,
    first: int,
    seed: int,
) -> list[Candidate]:
    """Runs for the recordings whose emulator is rough; none if all are exact.

    Args:
        library: of the rig.
        joint: the fitted recordings.
        names: of these, which are the levels of the runs.
        compared: hypotheses about them.
        first: further runs that were made before.
        seed: of the draws.
    """
    chosen = _leaders(compared)
    rough = [
        name
        for name, group in zip(names, joint.likelihood.groups, strict=True)
        if max(_doubt(joint, group, weighed) for weighed in chosen) > ROUGH
    ]
    rng, made = np.random.default_rng([seed, 4000, first]), list[Candidate]()
    for _ in range(EACH):
        for name in rough:
            nothing = rng.random() < 0.5
            weighed = chosen[0] if nothing else chosen[rng.integers(len(chosen))]
            x = frozen(_drawn(library, joint, weighed, rng))
            index = first + len(made)
            made.append(Candidate(index, x, name, FIRST_SEED + index, 0, "refine"))
    return made


def _leaders(compared: Compared) -> list[Weighed]:
    """The fit of nothing, and those of the effects that explain most alone."""
    single = [w for w in compared.weighed if len(w.which.suspects) == 1 and not w.which.other]
    best = sorted(single, key=lambda w: -w.log_evidence)[:LEADERS]
    return [compared.nothing, *best]


def _doubt(joint: Joint, group: Group, weighed: Weighed) -> float:
    """Variance of an emulator at the best point, over that of all other errors."""
    which = weighed.which
    d = len(weighed.best) - which.added
    z = joint.transform(weighed.best[:d])
    strengths = which.strengths(weighed.best[None, d:])[0]
    rig = [i for i, s in enumerate(which.suspects) if not s.measuring]
    points = np.append(z, strengths[rig])[None]
    numbers = [which.suspects[i].number for i in rig]
    _, variance = with_effects(group.emulator, numbers).predict(points)
    k = variance.shape[1]
    return float(variance.sum() / np.trace(group.fixed[:k, :k]))


def _drawn(library: Library, joint: Joint, weighed: Weighed, rng: np.random.Generator) -> Array:
    """The design (p,) of a run, from what a hypothesis leaves possible."""
    which = weighed.which
    middle = weighed.draws.mean(axis=0)
    wide = middle + WIDER * (weighed.draws[rng.integers(len(weighed.draws))] - middle)
    u = np.clip(wide, 0.0, 1.0)
    d = len(u) - which.added
    strengths = which.strengths(u[None, d:])[0]
    there = {
        s.number: float(v)
        for s, v in zip(which.suspects, strengths, strict=True)
        if not s.measuring
    }
    return library.design(joint.transform(u[:d]), there if which != NOTHING else {})
