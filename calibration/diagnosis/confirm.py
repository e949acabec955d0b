"""Real simulations with and without what is missing, beside every recording.

The simulations have the last word: where they do not fit to the recordings as their emulators did,
nothing is named. Where those with another effect of its class fit as well, both are named.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from calibration.diagnosis.compare import Compared
from calibration.diagnosis.joint import Joint
from calibration.diagnosis.library import Library
from calibration.diagnosis.verdict import CLEARLY, UNEXPLAINED, Verdict, mates_of
from calibration.diagnosis.weigh import Weighed
from calibration.diagnosis.where import in_points
from calibration.observed import Observed
from calibration.recordings.case import Case
from calibration.recordings.records import Recording
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
    both = (compared.nothing, compared.likeliest)
    recordings = (*case.fitted, *case.held_out)
    rows = simulated(recordings, library, joint, seen, both, evaluate, first)
    found = []
    for number, (its, pair) in enumerate(zip(seen, rows, strict=True)):
        if not pair:
            continue  # its simulations failed
        sd = joint.deviations[number]
        errors = [float(np.sqrt(np.mean(((its.values - row) / sd) ** 2))) for row in pair]
        held_out = number >= len(case.fitted)
        found.append(Confirmed(its.name, held_out, pair[0], pair[1], sd, (errors[0], errors[1])))
    return tuple(found)


def simulated(
    recordings: Sequence[Recording],
    library: Library,
    joint: Joint,
    seen: Sequence[Observed],
    those: Sequence[Weighed],
    evaluate: Evaluate,
    first: int,
) -> list[list[Array]]:
    """For each recording the mean (p,) of runs under each hypothesis; none where all runs failed.

    All hypotheses have the same packings.
    """
    asked = [
        Candidate(0, frozen(_design(library, joint, its)), r.name, 1 + n, 0, "predict")
        for n in range(RUNS)
        for r in recordings
        for its in those
    ]
    made = evaluate([_numbered(c, i) for i, c in enumerate(asked, start=first)])
    found = []
    for number, its in enumerate(seen[: len(recordings)]):
        mine = [e for e in made if e.candidate.level == its.name]
        rows = []
        for place, weighed in enumerate(those):
            runs = mine[place :: len(those)]
            raw = [its.row(e.outcome.raw) for e in runs if e.outcome.finished]
            if raw:
                rows.append(_measured(joint, number, weighed, np.array(raw)))
        found.append(rows if len(rows) == len(those) else [])
    return found


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
    misfit = _misfit(joint, best, [its.after for its in fitted])
    p = float(chi2.sf(misfit, max(1, len(joint.scores) - len(best.best))))
    if p >= UNEXPLAINED:
        return verdict
    why = f"simulations with {best.which.name} do not fit as their emulators do; give more --runs"
    return replace(verdict, kind="unknown", effects=(), unexplained=p, why=why)


def fits_of_mates(
    verdict: Verdict, compared: Compared, classes: Sequence[Sequence[str]]
) -> list[Weighed]:
    """Fits of the effects of one class with the only one that is named, the likeliest first."""
    if verdict.kind != "named" or len(verdict.effects) > 1:
        return []
    alone = {w.which.name: w for w in compared.explained if len(w.which.suspects) == 1}
    return [alone[m] for m in mates_of(compared, verdict.effects[0], classes, clear=False)]


def beside_mates(
    verdict: Verdict, joint: Joint, those: Sequence[Weighed], rows: Sequence[Sequence[Array]]
) -> Verdict:
    """The verdict; a set where simulations of others fit nearly as well as those of what is named.

    Args:
        verdict: that names one effect.
        joint: the fitted recordings.
        those: the hypothesis that is named, then its mates.
        rows: for each recording what is simulated under each of them (p,); none if runs failed.
    """
    if not all(rows):
        return verdict
    misfits = [_misfit(joint, w, [r[i] for r in rows]) for i, w in enumerate(those)]
    near = [
        w.which.name
        for w, misfit in zip(those[1:], misfits[1:], strict=True)
        if misfit - misfits[0] < 2.0 * CLEARLY
    ]
    if not near:
        return verdict
    why = "simulations with each of them fit as well"
    return replace(verdict, kind="set", effects=(*verdict.effects, *near), why=why)


def _misfit(joint: Joint, weighed: Weighed, rows: Sequence[Array]) -> float:
    """Chi-squared of the recordings against simulated rows (p,), each the mean of `RUNS` runs."""
    covariance = joint.covariances(weighed.which, weighed.best[None])[0]
    scores, at = [], 0
    for group, row in zip(joint.likelihood.groups, rows, strict=True):
        emulator = group.emulator
        k = len(emulator.components)
        covariance[at : at + k, at : at + k] += emulator.noise / RUNS
        at += len(group.scores)
        scores.append((row - emulator.mean) / emulator.scale @ group.basis.T)
    apart = joint.scores - np.concatenate(scores)
    return float(apart @ np.linalg.solve(covariance, apart))


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
