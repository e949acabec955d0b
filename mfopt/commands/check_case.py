"""`mfopt check` of a case: what was read of it, and which simulations a calibration would make."""

import os
from collections.abc import Iterable, Sequence
from contextlib import closing
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np
from rich.table import Table

from mfopt.campaign.executor import Runner
from mfopt.campaign.local_workers import local_processes
from mfopt.commands.shared import duration, screen
from mfopt.errors import ConfigError, SimulationError
from mfopt.names import with_unit
from mfopt.records.evaluation import Candidate, Evaluation
from mfopt.records.rig import Channel

if TYPE_CHECKING:
    from calibration.recordings.case import Case, Parameter
    from calibration.recordings.records import Recording
    from mfopt.study.case import AssembledCase


def check_case(path: Path, *, dry_run: bool) -> None:
    """Read a case and its recordings, and say what `mfopt calibrate` would do."""
    from calibration.recordings.notes import notes_by_files
    from mfopt.commands.calibrate import RUNS
    from mfopt.study.case import assemble_case

    parts = assemble_case(path)
    for table in (_recordings(parts), _noises(parts), _parameters(parts.case.parameters)):
        if table.row_count:
            screen.print(table)
    for line in (*notes_by_files(parts.case.recordings), *parts.doubts):
        screen.print(line)
    if parts.possible:
        names = ", ".join(level.name for level in parts.possible)
        screen.print(f"further experiments for --advise: {names}")
    screen.print(runs_in_words(parts.case, RUNS))
    if dry_run:
        seconds = _run_once(parts)
        workers = len(os.sched_getaffinity(0))
        screen.print(
            f"Every recording was simulated once, in the middle of the ranges. {RUNS} simulations "
            f"take about {duration(RUNS * seconds / workers)} on {workers} workers, the fit aside."
        )


def runs_in_words(case: "Case", runs: int) -> str:
    """How many simulations there are for what; or why there cannot be so many."""
    from calibration.campaign import runs_of_each
    from calibration.runs import predictions_of_each

    try:
        each = runs_of_each(case, runs)
    except ConfigError as error:
        return f"mfopt calibrate needs --runs: {error}"
    return (
        f"{runs} simulations unless --runs says otherwise: {each} of each fitted recording to "
        f"learn from, then {predictions_of_each(case, runs)} of each recording to check"
    )


def _recordings(parts: "AssembledCase") -> Table:
    """What was read of each channel of each recording, in SI units."""
    title = f"recordings of {parts.case.name}, in SI units"
    table = Table("recording", "channel", "repeats", "times", "values", title=title)
    table.columns[1].no_wrap = True
    for recording in parts.case.recordings:
        name = _named(recording)
        for channel in (*recording.channels, *recording.scalars):
            table.add_row(name, channel, *_read(recording, parts.rig.channels[channel]))
            name = ""
    return table


def _named(recording: "Recording") -> str:
    """Name of a recording, and under it what was set."""
    name = f"{recording.name} (held out)" if recording.held_out else recording.name
    conditions = (
        f"{key} = {its if isinstance(its, str) else f'{its:g}'}"
        for key, its in recording.conditions.items()
    )
    return "\n".join((name, *conditions))


def _read(recording: "Recording", channel: Channel) -> tuple[str, str, str]:
    """Repeats, times and values of a channel."""
    if channel.name in recording.scalars:
        numbers = [repeat.scalars[channel.name] for repeat in recording.repeats]
        return str(len(numbers)), "", _span(numbers, channel.unit)
    its = [r.series[channel.name] for r in recording.repeats if channel.name in r.series]
    samples = sorted({series.times.size for series in its})
    count = " to ".join(f"{n}" for n in dict.fromkeys((samples[0], samples[-1])))
    times = _span(np.concatenate([series.times for series in its]), "s")
    values = _span(np.concatenate([series.values for series in its]), channel.unit)
    return str(len(its)), f"{count} samples from {times}", values


def _span(values: Iterable[float], unit: str) -> str:
    """The smallest and the largest of these."""
    its = list(values)
    return with_unit(f"{min(its):.4g} to {max(its):.4g}", unit)


def _noises(parts: "AssembledCase") -> Table:
    """Measurement noise by channel."""
    table = Table("channel", "noise, 1 sd", "90 % interval", "", title="measurement noise")
    for noise in parts.noises.values():
        unit = parts.rig.channels[noise.channel].unit
        shown = with_unit(f"{noise.sigma:.3g}", unit)
        table.add_row(noise.channel, shown, _span(noise.sigma_range, "-"), noise.found)
    return table


def _parameters(parameters: Sequence["Parameter"]) -> Table:
    """What is fitted; a scene adds what nobody knows exactly."""
    table = Table("parameter", "from", "to", "prior", "unit", title="what is to be determined")
    for p in parameters:
        prior = "even" if p.mean is None else f"normal, {p.mean:g} with sd {p.sd:g}"
        name = p.name if p.asked else f"{p.name} (fitted along)"
        even = f"{prior} in the logarithm" if p.log else prior
        table.add_row(name, f"{p.low:g}", f"{p.high:g}", even, p.unit)
    return table


def _run_once(parts: "AssembledCase") -> float:
    """Simulate every recording once in the middle of the ranges; the mean time of a run [s].

    Raises:
        ConfigError: if recording and simulation have no time in common, or far other durations.
        SimulationError: if a run fails or lacks a channel of the recording.
    """
    from calibration.durations import unlike_durations
    from calibration.runs import check_times, flaw
    from fidelity.engines.numba import prepare
    from fidelity.rig import SceneRig

    if isinstance(parts.rig, SceneRig):
        prepare(lambda: screen.print("compiling the grain engine, once: about 30 s"))
    x, seed = parts.problem.baseline, parts.case.seed
    # In a process of its own: the user's function may end the process, or keep it from ending.
    with closing(Runner(local_processes(1))) as runner:
        runner.check(parts.ladder)  # starts the process, which takes no part in the time of a run
        began = perf_counter()
        for recording in parts.case.recordings:
            candidate = Candidate(0, x, recording.name, seed, 0, "design")
            ((_, outcome),) = runner.run(parts.ladder, [candidate])
            its = Evaluation(candidate, outcome, 0.0)
            if (why := flaw(its, recording)) is not None:
                raise SimulationError(f"recording {recording.name!r}: the simulation failed: {why}")
            check_times(recording, [its])
            for line in unlike_durations([recording], [its]):
                screen.print(line)
        return (perf_counter() - began) / len(parts.case.recordings)
