"""Runs of a calibration: made for recordings, checked, and put beside them."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from calibration.observed import Observed, observed
from calibration.posterior import from_unit
from calibration.recordings.case import Case, Parameter
from calibration.recordings.records import Noise, Recording
from mfopt.arrays import Array
from mfopt.errors import SimulationError
from mfopt.records.evaluation import Candidate, Evaluation, Purpose
from mfopt.records.rig import TIME

PREDICTED = 6  # runs for each recording beside those that fit, where they cost less than this
SPARED = 0.25  # of all runs
FEWEST_PREDICTED = 3
MOST_FAILED = 0.5  # of the runs of a recording

Evaluate = Callable[[Sequence[Candidate]], list[Evaluation]]  # runs, stores, resumes
See = Callable[[Recording, float], Observed]  # a recording up to the end of the simulation [s]


@dataclass(frozen=True, slots=True, eq=False)
class Predicted:
    """A recording beside runs with parameters that the fit leaves possible."""

    observation: Observed
    runs: Array  # (n, p) one run each, on a packing and parameters of its own
    parameters: Array  # (n, d)
    held_out: bool


def predictions_of_each(case: Case, runs: int) -> int:
    """Runs of the posterior for each recording."""
    return max(FEWEST_PREDICTED, min(PREDICTED, int(SPARED * runs / len(case.recordings))))


def predicted(
    case: Case,
    see: See,
    evaluate: Evaluate,
    z: Array,
    count: int,
    first: int,
) -> tuple[tuple[Predicted, ...], list[Evaluation]]:
    """Run parameters under the conditions of every recording, those held out as well.

    Args:
        case: with the recordings.
        see: puts a recording in a row.
        evaluate: makes the runs.
        z: equally likely parameters (n, d) in the unit cube, of which `count` are drawn.
        count: runs for each recording.
        first: runs that were made before.
    """
    rng = np.random.default_rng([case.seed, 2000])
    points = [(r, z[rng.integers(0, len(z), count)]) for r in case.recordings]
    made = evaluate(candidates(case.parameters, points, first, "predict"))
    beside = []
    for recording in case.recordings:
        seen, x, rows = recording_with_runs(recording, made, see)
        beside.append(Predicted(seen, rows, x, recording.held_out))
    return tuple(beside), made


def candidates(
    parameters: Sequence[Parameter],
    points: Sequence[tuple[Recording, Array]],
    first: int,
    purpose: Purpose,
) -> list[Candidate]:
    """One run a point, each on a packing of its own; the recordings in turn."""
    made: list[Candidate] = []
    for row in range(max(len(z) for _, z in points)):
        for recording, z in points:
            if row < len(z):
                index = first + len(made)
                x = np.clip(
                    from_unit(parameters, z[row]),
                    [p.low for p in parameters],
                    [p.high for p in parameters],
                )
                made.append(Candidate(index, x, recording.name, index + 1, 0, purpose))
    return made


def finished(made: Sequence[Evaluation], recording: Recording) -> list[Evaluation]:
    """The finished runs under the conditions of a recording, with values of all its channels.

    Raises:
        SimulationError: if most failed; with the last reason.
    """
    all_of_it = [e for e in made if e.candidate.level == recording.name]
    names = (*recording.channels, *recording.scalars)
    flaws = [flaw(e, names) for e in all_of_it]
    its = [e for e, why in zip(all_of_it, flaws, strict=True) if why is None]
    if len(its) < MOST_FAILED * len(all_of_it):
        why = next(why for why in reversed(flaws) if why is not None)
        raise SimulationError(
            f"recording {recording.name!r}: {len(all_of_it) - len(its)} of {len(all_of_it)} runs "
            f"failed, the last because {why}"
        )
    return its


def flaw(its: Evaluation, channels: Iterable[str]) -> str | None:
    """Why a run cannot be compared with a recording of these channels, or None."""
    if not its.outcome.finished:
        return its.outcome.why
    lacking = [channel for channel in channels if channel not in its.outcome.raw]
    return f"it gives no {lacking[0]}" if lacking else None


def end_of(made: Sequence[Evaluation]) -> float:
    """The end of the shortest run [s]; 1 where runs give no series."""
    ends = [float(e.outcome.raw[TIME][-1]) for e in made if TIME in e.outcome.raw]
    return min(ends, default=1.0)


def seeing(case: Case, noises: Mapping[str, Noise]) -> See:
    """Puts recordings of a case in a row, each once for every end of the simulated time.

    A recording of many samples takes seconds, and each of several fits asks for all of them.
    """

    @cache
    def see(recording: Recording, end: float) -> Observed:
        return observed(recording, case.measurement, noises, end)

    return see


def recording_with_runs(
    recording: Recording, made: Sequence[Evaluation], see: See
) -> tuple[Observed, Array, Array]:
    """A recording beside its finished runs: their parameters (n, d) and rows (n, p).

    Raises:
        ConfigError: if recording and simulation have no time in common.
        SimulationError: if most runs of the recording failed.
    """
    its = finished(made, recording)
    seen = see(recording, end_of(its))
    x = np.array([e.candidate.x for e in its])
    return seen, x, np.array([seen.row(e.outcome.raw) for e in its])
