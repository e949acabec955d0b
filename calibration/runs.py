"""Runs of a calibration: made for recordings, checked, and put beside them."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from calibration.durations import check_durations
from calibration.observed import Observed, observed, points_in_time
from calibration.posterior import from_unit
from calibration.recordings.case import Case, Parameter
from calibration.recordings.records import Noise, Recording
from mfopt.arrays import Array
from mfopt.errors import ConfigError, SimulationError
from mfopt.records.evaluation import Candidate, Evaluation, Purpose
from mfopt.records.rig import TIME

PREDICTED = 6  # runs for each recording beside those that fit, where they cost less than this
SPARED = 0.25  # of all runs
FEWEST_PREDICTED = 3
MOST_FAILED = 0.5  # of the runs of a recording
LATE = 1.01  # steps by which a run may begin late; 0.01 for rounding

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
        SimulationError: if most failed; with the most frequent reason.
    """
    all_of_it = [e for e in made if e.candidate.level == recording.name]
    flaws = [flaw(e, recording) for e in all_of_it]
    its = [e for e, why in zip(all_of_it, flaws, strict=True) if why is None]
    if len(its) < MOST_FAILED * len(all_of_it):
        raise SimulationError(
            f"recording {recording.name!r}: {len(all_of_it) - len(its)} of {len(all_of_it)} runs "
            f"failed, and at least {100 * MOST_FAILED:.0f} % must end; mend the simulation, or "
            f"narrow the ranges to where it works. {most_frequent(flaws)}"
        )
    return its


def most_frequent(flaws: Sequence[str | None]) -> str:
    """The most frequent reason, by its first line, and how many runs have it."""
    reasons = [why for why in flaws if why is not None]
    ((first, count),) = Counter(why.partition("\n")[0] for why in reasons).most_common(1)
    why = next(why for why in reversed(reasons) if why.partition("\n")[0] == first)
    if count == len(reasons):
        return f"The reason of {'all' if count > 1 else 'this'}: {why}"
    return f"The most frequent reason, of {count} runs: {why}"


def flaw(its: Evaluation, recording: Recording) -> str | None:
    """Why a run cannot be compared with a recording, or None."""
    if not its.outcome.finished:
        return its.outcome.why
    raw = its.outcome.raw
    for name in (*recording.channels, *recording.scalars):
        if name not in raw:
            return f"it gives no {name}"
        is_series = raw[name].size > 1
        if is_series is not (name in recording.channels):
            kinds = ("a series", "a number") if is_series else ("a number", "a series")
            return f"it gives {name} as {kinds[0]}, and the recording has {kinds[1]}"
    return None


def end_of(made: Sequence[Evaluation]) -> float:
    """The end of the shortest run [s]; 1 where runs give no series."""
    ends = [float(e.outcome.raw[TIME][-1]) for e in made if TIME in e.outcome.raw]
    return min(ends, default=1.0)


def check_times(recording: Recording, its: Sequence[Evaluation]) -> None:
    """See that a recording and finished runs of it have time in common, from the start on.

    A run may begin a step late: at the first point that it gives, or that is compared.

    Raises:
        ConfigError: if they have none, a run begins later, or one lasts far longer than the other.
    """
    check_durations(recording, its)
    for channel in recording.channels if its else ():
        points = points_in_time(recording, channel, end_of(its))
        for e in its:
            first, second = map(float, e.outcome.raw[TIME][:2])
            if first - points[0] > LATE * max(second - first, points[1] - points[0]):
                raise ConfigError(
                    f"recording {recording.name!r}: its {channel} is compared from "
                    f"{points[0]:g} s on, and a run begins at {first:g} s; simulate from time 0, "
                    "the start of the experiment"
                )


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
        ConfigError: if recording and simulation have no time in common, or a run begins too late.
        SimulationError: if most runs of the recording failed.
    """
    its = finished(made, recording)
    check_times(recording, its)
    seen = see(recording, end_of(its))
    x = np.array([e.candidate.x for e in its])
    return seen, x, np.array([seen.row(e.outcome.raw) for e in its])
