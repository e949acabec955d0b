"""A whole diagnosis: library, comparison, test, where, verdict, and what is shown of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import chi2

from calibration.diagnosis.alike import alike, faint
from calibration.diagnosis.compare import Compared, compare
from calibration.diagnosis.confirm import (
    RUNS,
    Confirmed,
    beside_mates,
    checked,
    confirmed,
    fits_of_mates,
    simulated,
)
from calibration.diagnosis.joint import Joint, Suspect
from calibration.diagnosis.library import Library
from calibration.diagnosis.linear import around
from calibration.diagnosis.measuring import MeasuringEffect, measuring_effects, shape
from calibration.diagnosis.next_recording import Separation, separations, still_possible
from calibration.diagnosis.nulls import Mismatch, mismatch_in
from calibration.diagnosis.refine import ROUNDS, refined
from calibration.diagnosis.repeats import with_repeat_scatter
from calibration.diagnosis.shown import HeldOut, held_out_errors
from calibration.diagnosis.verdict import Verdict, judged
from calibration.diagnosis.weigh import weigh_nothing
from calibration.diagnosis.where import Cell, cells
from calibration.likelihood import likelihood
from calibration.observed import Observed
from calibration.posterior import prior_transform
from calibration.recordings.case import Case
from calibration.recordings.records import Noise, Recording
from calibration.runs import Evaluate, See, end_of, finished, seeing
from mfopt.arrays import AnyArray, Array
from mfopt.errors import ConfigError
from mfopt.records.evaluation import Evaluation
from mfopt.records.rig import Channel
from surrogates.effects import Runs
from surrogates.series import SeriesEmulator, fit_effect_series

FEWEST = 60  # runs of an experiment


@dataclass(frozen=True, slots=True, eq=False)
class Examined:
    """What recordings say, before any further simulation."""

    observations: tuple[Observed, ...]  # the fitted ones, then those held out
    joint: Joint  # of all of them
    measuring: tuple[MeasuringEffect, ...]
    compared: Compared
    test: Mismatch
    cells: tuple[Cell, ...]
    rest: float | None  # p-value of the misfit of all that lies outside of the cells that stand out
    verdict: Verdict
    classes: tuple[tuple[str, ...], ...]  # effects that these recordings cannot tell apart
    faint: tuple[str, ...]  # effects that they cannot show
    held_out: tuple[HeldOut, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Diagnosis:
    """What was found about the recordings of a case."""

    examined: Examined
    confirmed: tuple[Confirmed, ...]
    next: tuple[Separation, ...]  # the best first


def diagnose(
    case: Case,
    library: Library,
    experiments: Mapping[str, str],
    noises: Mapping[str, Noise],
    channels: Mapping[str, Channel],
    made: Sequence[Evaluation],
    evaluate: Evaluate,
) -> Diagnosis:
    """Diagnose the recordings of a case.

    Args:
        case: with at least one recording that is fitted.
        library: of the rig.
        experiments: the experiment in the library of each recording, by its name.
        noises: measurement noise by channel.
        channels: of the rig, by name.
        made: the runs of the library.
        evaluate: makes further runs; the level is the name of the recording.

    Raises:
        ConfigError: if recording and simulation have no time in common, or the runs are too few.
        SimulationError: if most runs of an experiment fail.
    """
    see, own = seeing(case, noises), list[Evaluation]()
    names = [recording.name for recording in case.fitted]
    seen, emulators = learned_from(case, library, experiments, see, made)
    for _ in range(ROUNDS):
        measuring, whole = joined(case, seen, emulators, channels)
        joint = whole.of(range(len(names)))
        compared = compare(joint, suspected(library, measuring), len(case.parameters), case.seed)
        asked = refined(library, joint, names, compared, len(own), case.seed)
        if not asked:
            break
        own += evaluate(asked)
        for place, recording in enumerate(case.fitted):
            if any(candidate.level == recording.name for candidate in asked):
                seen[place], emulators[place] = _learned(
                    recording, experiments[recording.name], library, see, (*made, *own)
                )
    found = examine(case, library, seen, emulators, channels)
    shown = confirmed(case, library, found.joint, seen, found.compared, evaluate, len(own))
    fitted = found.joint.of(range(len(names)))
    verdict = checked(found.verdict, fitted, found.compared, shown)
    if mates := fits_of_mates(verdict, found.compared, found.classes):
        those = (found.compared.likeliest, *mates)
        first = len(own) + 2 * RUNS * len(seen)
        rows = simulated(case.fitted, library, fitted, seen, those, evaluate, first)
        verdict = beside_mates(verdict, fitted, those, rows)
    return Diagnosis(
        replace(found, verdict=verdict), shown, _next(found, library, made, experiments)
    )


def learned_from(
    case: Case,
    library: Library,
    experiments: Mapping[str, str],
    see: See,
    made: Sequence[Evaluation],
) -> tuple[list[Observed], list[SeriesEmulator]]:
    """All recordings, the fitted ones first, and the emulators of their experiments."""
    pairs = [
        _learned(recording, experiments[recording.name], library, see, made)
        for recording in (*case.fitted, *case.held_out)
    ]
    return [seen for seen, _ in pairs], [emulator for _, emulator in pairs]


def _learned(
    recording: Recording, experiment: str, library: Library, see: See, made: Sequence[Evaluation]
) -> tuple[Observed, SeriesEmulator]:
    seen, runs, rows = beside(recording, experiment, made, library, see)
    return seen, fit_effect_series(runs, rows, [block.size for block in seen.blocks])


def examine(
    case: Case,
    library: Library,
    seen: Sequence[Observed],
    emulators: Sequence[SeriesEmulator],
    channels: Mapping[str, Channel],
) -> Examined:
    """Examine recordings with the emulators of their experiments.

    Args:
        case: with at least one recording that is fitted.
        library: of the rig.
        seen: the recordings that are fitted, then those held out.
        emulators: of each.
        channels: of the rig, by name.
    """
    measuring, whole = joined(case, seen, emulators, channels)
    suspects = suspected(library, measuring)
    count, d, seed = len(case.fitted), len(case.parameters), case.seed
    joint = whole.of(range(count))
    compared = compare(joint, suspects, d, seed)
    near = around(joint, suspects, compared.nothing.best)
    test = mismatch_in(joint, near, compared, seed)
    its_cells = cells(joint, seen[:count], near, compared, seed)
    names = [recording.name for recording in case.fitted]
    classes = alike(near)
    return Examined(
        tuple(seen), whole, measuring, compared, test, its_cells,
        _rest(joint, seen[:count], its_cells, d, seed),
        judged(joint, names, compared, test, classes, seed), classes, faint(near),
        held_out_errors(whole, seen, count, compared),
    )  # fmt: skip


def suspected(library: Library, measuring: Sequence[MeasuringEffect]) -> tuple[Suspect, ...]:
    """All effects that may be there: those of the rig, then those of measuring."""
    return (
        *(Suspect(e.name, i, False, e.signed) for i, e in enumerate(library.effects)),
        *(Suspect(m.name, i, True, m.signed) for i, m in enumerate(measuring)),
    )


def beside(
    recording: Recording, experiment: str, made: Sequence[Evaluation], library: Library, see: See
) -> tuple[Observed, Runs, Array]:
    """A recording beside the runs of its experiment: where they were made, and their rows (n, p).

    Raises:
        ConfigError: if recording and simulation have no time in common, or the runs are too few.
        SimulationError: if most runs failed.
    """
    its = of_experiment(made, experiment, recording)
    if len(its) < FEWEST:
        raise ConfigError(
            f"{len(its)} runs are too few to learn the effects of {experiment!r} from; at least "
            f"{FEWEST} are needed: raise --runs"
        )
    seen = see(recording, end_of(its))
    return seen, library.runs(its), np.array([seen.row(e.outcome.raw) for e in its])


def of_experiment(
    made: Sequence[Evaluation], experiment: str, recording: Recording
) -> list[Evaluation]:
    """The finished runs of an experiment that can be compared with a recording of it."""
    mine = [
        replace(e, candidate=replace(e.candidate, level=recording.name))
        for e in made
        if e.candidate.level in (experiment, recording.name)
    ]
    return finished(mine, recording)


def joined(
    case: Case,
    seen: Sequence[Observed],
    emulators: Sequence[SeriesEmulator],
    channels: Mapping[str, Channel],
) -> tuple[tuple[MeasuringEffect, ...], Joint]:
    """The effects of measuring these recordings, and all recordings in one."""
    names = sorted({block.channel for its in seen for block in its.blocks})
    lengths = {name: channels[name].unit == "m" for name in names}
    measuring = measuring_effects(names, any(lengths.values()))
    likely, deviations = with_repeat_scatter(likelihood(seen, emulators), seen)
    shapes = tuple(
        tuple(shape(m, its, group.emulator, group.basis, lengths) for m in measuring)
        for its, group in zip(seen, likely.groups, strict=True)
    )
    return measuring, Joint(likely, shapes, prior_transform(case.parameters), deviations)


def _rest(
    joint: Joint, seen: Sequence[Observed], its_cells: Sequence[Cell], d: int, seed: int
) -> float | None:
    """P-value of the misfit of all points outside of the cells that stand out, fitted alone."""
    out = [
        np.concatenate(
            [
                np.any(
                    [
                        np.zeros(block.size, dtype=bool),
                        *(
                            _inside(block.times, cell)
                            for cell in its_cells
                            if cell.stands_out
                            and (cell.recording, cell.channel) == (its.name, block.channel)
                        ),
                    ],
                    axis=0,
                )
                for block in its.blocks
            ]
        )
        for its in seen
    ]
    blinded, lost = joint.blind(out)
    freedom = len(joint.scores) - lost - d
    if not lost or freedom < 1:
        return None
    return float(chi2.sf(weigh_nothing(blinded, d, seed).misfit, freedom))


def _inside(times: Array | None, cell: Cell) -> AnyArray:
    if times is None:
        return np.ones(1, dtype=bool)
    return np.asarray((times >= cell.start) & (times <= cell.end))


def _next(
    its: Examined, library: Library, made: Sequence[Evaluation], experiments: Mapping[str, str]
) -> tuple[Separation, ...]:
    """The recordings that would separate best what is still possible."""
    left, found = still_possible(its.compared), list[Separation]()
    errors = _errors(its.joint, its.observations)
    recorded = {experiments[name]: name for name in reversed(list(experiments))}
    for name in dict.fromkeys(e.candidate.level for e in made):
        mine = [e for e in made if e.candidate.level == name and e.outcome.finished]
        raw = [e.outcome.raw for e in mine]
        called = f"as {recorded[name]} ({name})" if name in recorded else name
        found += separations(left, called, library.runs(mine), raw, errors, its.joint.transform)
    return tuple(sorted(found, key=lambda s: -s.gain))


def _errors(joint: Joint, seen: Sequence[Observed]) -> dict[str, float]:
    """Errors of one repeat of each recorded channel, 1 sd: the largest of all recordings."""
    found: dict[str, float] = {}
    for its, sd in zip(seen, joint.deviations, strict=True):
        own = np.sqrt(its.repeats * sd**2 + np.sum(its.constant**2, axis=1))
        for channel, part in its.split(own).items():
            mean = float(np.sqrt(np.mean(part**2)))
            found[channel] = max(mean, found.get(channel, 0.0))
    return found
