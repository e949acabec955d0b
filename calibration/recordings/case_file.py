"""A case: its file and all recordings that the file names, read with the channels of the rig."""

import math
import os
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from calibration.recordings.agreement import agreeing, check_scalars
from calibration.recordings.case import Case, Known, Measurement
from calibration.recordings.case_settings import (
    CaseSettings,
    CsvSettings,
    KnownSettings,
    MeasurementSettings,
    RecordingSettings,
    ScalarSettings,
)
from calibration.recordings.header import unit_for
from calibration.recordings.records import Recording, Repeat
from calibration.recordings.series_file import Source, read_repeat
from calibration.recordings.size import check_number
from mfopt.errors import ConfigError
from mfopt.records.rig import Channel
from mfopt.settings import nearest

Channels = Mapping[str, Channel]
CHANCE = 8  # different values or more that are equal in two experiments are no chance
LARGEST_ERROR = 100.0  # [usual size of a channel] 1 sd; with more the recording says nothing


def complete_case(settings: CaseSettings, path: Path, channels: Channels) -> Case:
    """Read the recordings of a case file that has been read.

    Two steps, because the table `rig` of the case file decides which channels there are.

    Args:
        settings: of the case file.
        path: of the case file, from whose folder the recordings are named.
        channels: what the rig can give, by name.

    Raises:
        ConfigError: if a recording cannot be trusted.
    """
    given = settings.measurement.known(str(path))
    _check_names(given, channels, f"{path}: measurement")
    known = {name: _known(table, channels[name], str(path)) for name, table in given.items()}
    limits = {
        name: _limits(table.limits, table, channels[name], str(path))
        for name, table in given.items()
        if table.limits is not None
    }
    recordings = tuple(
        _recording(its, settings, path, channels, limits, known) for its in settings.recording
    )
    _check_recordings(recordings, path)
    _check_columns(settings.csv, recordings, str(path))
    return Case(
        name=settings.case.name,
        seed=settings.case.seed,
        rig=settings.rig,
        parameters=tuple(p.named(name) for name, p in settings.parameters.items()),
        measurement=Measurement(settings.measurement.clock_error, known),
        recordings=recordings,
    )


def _recording(
    its: RecordingSettings,
    settings: CaseSettings,
    path: Path,
    channels: Channels,
    limits: Mapping[str, tuple[float, float]],
    known: Mapping[str, Known],
) -> Recording:
    where = f"{path}: recording {its.name!r}"
    repeats = tuple(
        read_repeat(
            Source(_shown(file, rows), path.parent / file, rows),
            channels,
            layout=settings.csv.layout,
            limits=limits,
            start_sd_s=_start(settings.measurement),
        )
        for file, rows in its.sources
    )
    repeats = _with_scalars(repeats, its.scalars, channels, where)
    recording = Recording(its.name, its.conditions, repeats, its.held_out)
    tolerance = settings.measurement.repeat_tolerance
    for name in recording.channels:
        repeats = agreeing(repeats, channels[name], tolerance, where, known.get(name, Known()))
    for name in recording.scalars:
        check_scalars(repeats, channels[name], tolerance, where, known.get(name, Known()))
    return Recording(its.name, its.conditions, repeats, its.held_out)


def _shown(file: str, rows: Mapping[str, float | str]) -> str:
    """How a repeat is called: the file, and the rows that were chosen."""
    chosen = ", ".join(f"{name} = {value}" for name, value in rows.items())
    return f"{file} ({chosen})" if chosen else file


def _start(measurement: MeasurementSettings) -> float | None:
    offset = measurement.clock_offset_s
    return math.inf if offset == "unknown" else offset


def _with_scalars(
    repeats: tuple[Repeat, ...],
    scalars: Mapping[str, ScalarSettings],
    channels: Channels,
    where: str,
) -> tuple[Repeat, ...]:
    """The repeats with their numbers; repeats of numbers alone if there are no files."""
    if not scalars:
        return repeats
    _check_names(scalars, channels, f"{where}: scalars")
    columns = {name: _values(its, channels[name], where) for name, its in scalars.items()}
    count = len(next(iter(columns.values())))
    made = repeats or tuple(Repeat("", {}) for _ in range(count))
    return tuple(
        replace(repeat, scalars={name: column[i] for name, column in columns.items()})
        for i, repeat in enumerate(made)
    )


def _values(scalar: ScalarSettings, channel: Channel, where: str) -> list[float]:
    place = f"{where}: scalars.{channel.name}"
    unit = unit_for(channel, scalar.unit, place)
    for value in scalar.values:
        check_number(channel, value, unit, place)
    return [value * unit.factor for value in scalar.values]


def _known(table: KnownSettings, channel: Channel, where: str) -> Known:
    factor = _factor(table, channel, where)
    for key, given in (("offset", table.offset), ("noise", table.noise or 0.0)):
        if factor * given > LARGEST_ERROR * channel.size:
            raise ConfigError(
                f"{where}: measurement.{channel.name}.{key} = {given:g} must be at most "
                f"{LARGEST_ERROR:g} times the usual size of the channel, "
                f"{LARGEST_ERROR * channel.size / factor:g}; lower it, or correct its unit"
            )
    noise = None if table.noise is None else factor * table.noise
    return Known(factor * table.offset, table.scale, noise)


def _limits(
    limits: tuple[float, float], table: KnownSettings, channel: Channel, where: str
) -> tuple[float, float]:
    factor = _factor(table, channel, where)
    return factor * limits[0], factor * limits[1]


def _factor(table: KnownSettings, channel: Channel, where: str) -> float:
    """From the unit of the table to SI."""
    place = f"{where}: measurement.{channel.name}"
    return unit_for(channel, table.unit or channel.unit, place).factor


def _check_names(names: Iterable[str], channels: Channels, where: str) -> None:
    for name in names:
        if name not in channels:
            raise ConfigError(f"{where}: the rig has no channel {name!r}{nearest(name, channels)}")


def _check_columns(csv: CsvSettings, recordings: Iterable[Recording], where: str) -> None:
    """See that every column that the case file speaks of is in a file; files may differ."""
    repeats = [repeat for recording in recordings for repeat in recording.repeats]
    there = {cell: None for repeat in repeats for cell in repeat.header if cell}
    for key, names in (("rename", csv.rename), ("ignore", csv.ignore)):
        for name in names:
            if name not in there:
                raise ConfigError(
                    f"{where}: csv.{key}: no file has a column {name!r}; there are "
                    f"{', '.join(map(repr, there)) or 'none'}; write the header as in the file, or "
                    "remove the entry"
                )


def _check_recordings(recordings: tuple[Recording, ...], path: Path) -> None:
    names = [recording.name for recording in recordings]
    for name in names:
        if names.count(name) > 1:
            raise ConfigError(f"{path}: two recordings are called {name!r}; rename one")
    seen: dict[str, str] = {}
    for recording in recordings:
        for repeat in recording.repeats:
            file = os.path.normpath(repeat.file)  # `./run.csv` is `run.csv`
            if repeat.file and file in seen:
                raise ConfigError(
                    f"{path}: {file} is in recordings {seen[file]!r} and "
                    f"{recording.name!r}; a run counts once: leave it out of one"
                )
            seen[file] = recording.name
    _check_copies(recordings, path)
    if all(recording.held_out for recording in recordings):
        raise ConfigError(
            f"{path}: all {len(names)} recordings are held out; set held_out = false for those "
            "that are to be fitted"
        )


def _check_copies(recordings: tuple[Recording, ...], path: Path) -> None:
    """See that no series of an experiment is that of another one, in another file."""
    seen: dict[tuple[str, bytes, bytes], tuple[str, str]] = {}
    for recording in recordings:
        for repeat in recording.repeats:
            for channel, its in repeat.series.items():
                if np.unique(its.values).size < CHANCE:
                    continue
                file, name = seen.setdefault(
                    (channel, its.times.tobytes(), its.values.tobytes()),
                    (repeat.file, recording.name),
                )
                if name != recording.name:
                    raise ConfigError(
                        f"{path}: {repeat.file} of {recording.name!r} holds the same "
                        f"{its.times.size} values of {channel} as {file} of {name!r}; a run counts "
                        "once: leave it out of one"
                    )
