"""Real simulations with and without what is missing, beside every recording.

The simulations have the last word: where they do not fit to the recordings as their emulators did,
nothing is named.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from calibration.diagnosis.compare import Compared
from calibration.diagnosis.joint import Joint
from calibration.diagnosis.library import Library
from calibration.diagnosis.verdict import UNEXPLAINED, Verdict
from calibration.diagnosis.weigh import Weighed
from calibration.diagnosis.where import in_points
from calibration.observed import Observed
from calibration.recordings.case import Case
from calibration.runs import Evaluate
from mfopt.arrays import Array, frozen
from mfopt.records.evaluation import Candidate

RUNS = 4  # of each recording, on packings of their own


@dataclass(frozen=True, slots=True, eq=False)
class Confirmed:
    """One recording beside simulations, mean over the runs, on the points of the recording (p,)."""

    recording: str
    held_out: bool
    before: Array  # the best fit of nothing
    after: Array  # with the likeliest effect; the same where none is likely
    sd: Array  # of the mean of the repeats
    errors: tuple[float, float]  # before and after: rms of recorded less simulated over `sd`


def confirmed(
    case: Case,
    library: Library,
    joint: Joint,
    seen: Sequence[Observed],
    compared: Compared,
    evaluate: Evaluate,
    first: int,
) -> tuple[Confirmed, ...]:
    """Simulate all recordings, in the order of `joint`, at the most likely points.

    `first` further runs were made before.
    """
    best = compared.likeliest
    both = (compared.nothing, best)
    asked = [
        Candidate(0, frozen(_design(library, joint, its)), r.name, 1 + n, 0, "predict")
        for n in range(RUNS)
        for r in (*case.fitted, *case.held_out)
        for its in both
    ]
    made = evaluate([_numbered(c, i) for i, c in enumerate(asked, start=first)])
    found = []
    for number, its in enumerate(seen):
        mine = [e for e in made if e.candidate.level == its.name]
        rows = []
        for weighed, runs in zip(both, (mine[0::2], mine[1::2]), strict=True):
            raw = [its.row(e.outcome.raw) for e in runs if e.outcome.finished]
            if not raw:
                break
            rows.append(_measured(joint, number, weighed, np.array(raw)))
        if len(rows) < len(both):
            continue  # its simulations failed
        sd = joint.deviations[number]
        errors = [float(np.sqrt(np.mean(((its.values - row) / sd) ** 2))) for row in rows]
        held_out = number >= len(case.fitted)
        found.append(Confirmed(its.name, held_out, rows[0], rows[1], sd, (errors[0], errors[1])))
    return tuple(found)


def checked(
    verdict: Verdict, joint: Joint, compared: Compared, found: Sequence[Confirmed]
) -> Verdict:
    """The verdict; that something unknown is missing where the simulations do not fit.

    Args:
        verdict: from the emulators.
        joint: the fitted recordings.
        compared: hypotheses about them.
        found: simulations beside all recordings, the fitted ones first.
    """
    fitted = [its for its in found if not its.held_out]
    groups = joint.likelihood.groups
    if verdict.kind not in ("named", "set") or len(fitted) < len(groups):
        return verdict
    best = compared.likeliest
    rows = [its.after - g.emulator.mean for its, g in zip(fitted, groups, strict=True)]
    scores = [r / g.emulator.scale @ g.basis.T for r, g in zip(rows, groups, strict=True)]
    covariance = joint.covariances(best.which, best.best[None])[0]
    at = 0
    for group in groups:
        k = len(group.emulator.components)
        covariance[at : at + k, at : at + k] += group.emulator.noise / RUNS
        at += len(group.scores)
    apart = joint.scores - np.concatenate(scores)
    misfit = float(apart @ np.linalg.solve(covariance, apart))
    p = float(chi2.sf(misfit, max(1, len(apart) - len(best.best))))
    if p >= UNEXPLAINED:
        return verdict
    why = f"simulations with {best.which.name} do not fit as their emulators do; give more --runs"
    return replace(verdict, kind="unknown", effects=(), unexplained=p, why=why)


def _measured(joint: Joint, number: int, weighed: Weighed, raw: Array) -> Array:
    """Mean (p,) of runs (n, p) as they would be recorded: measuring changes their scores."""
    group = joint.likelihood.groups[number]
    mean = raw.mean(axis=0)
    scores = ((mean - group.emulator.mean) / group.emulator.scale @ group.basis.T)[None]
    changed = joint.as_recorded(number, weighed.which, weighed.best[None], scores) - scores
    return np.asarray(mean + in_points(group, changed[0]))


def _design(library: Library, joint: Joint, weighed: Weighed) -> Array:
    which = weighed.which
    d = len(weighed.best) - which.added
    strengths = which.strengths(weighed.best[None, d:])[0]
    there = {
        suspect.number: float(s)
        for suspect, s in zip(which.suspects, strengths, strict=False)
        if not suspect.measuring
    }
    return library.design(joint.transform(weighed.best[:d]), there)


def _numbered(its: Candidate, index: int) -> Candidate:
    return Candidate(index, its.x, its.level, its.seed, its.generation, its.purpose)
