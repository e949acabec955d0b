"""One CSV file of series: read, mended where that is safe, refused where it is not."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calibration.recordings import quality
from calibration.recordings.header import TIME, Column, Layout, columns_of
from calibration.recordings.numbers import check_one_decimal_sign, is_number, number_of
from calibration.recordings.records import Repeat, Series
from calibration.recordings.size import check_size
from calibration.recordings.text import Row, Table, counted, read_table
from calibration.recordings.units import unit_of
from mfopt.arrays import Array, BoolArray, IntArray
from mfopt.errors import ConfigError
from mfopt.records.rig import Channel
from mfopt.settings import nearest

COARSE = 0.002  # share of a series' range; larger steps between values are said
LATE_STEPS = 2.0  # a recording that begins later than so many steps has an unknown start

Chosen = Mapping[str, str | float]  # header of a column -> what its cells must be
Limits = Mapping[str, tuple[float, float]]  # by channel: smallest and largest value of the sensor


@dataclass(frozen=True, slots=True)
class Source:
    """A file of a recording, and which of its rows belong to one run."""

    name: str  # as the case file names it
    path: Path
    rows: Chosen


def read_repeat(
    source: Source,
    channels: Mapping[str, Channel],
    *,
    layout: Layout,
    limits: Limits,
    start_sd_s: float | None,
) -> Repeat:
    """Read one run of an experiment.

    Args:
        source: the file.
        channels: what the rig can give.
        layout: what the case file says of the columns.
        limits: of the sensors that have known ones.
        start_sd_s: 1 sd of where time 0 lies [s]; inf: unknown; None: judged from the times.

    Raises:
        ConfigError: if the file cannot be trusted; the message names file and line.
    """
    path = source.path
    table = _with_units(read_table(path))
    header = table.rows[0]
    _check_chosen(source, header)
    columns = columns_of(header, channels, layout, list(source.rows), f"{path}, line {header.line}")
    rows = _chosen_rows(source, table)
    notes = [*table.notes, *_extra_columns(table, rows, layout, path)]
    times, values, lines = _numbers(rows, columns, path, notes)
    times, values, lines = _ordered(times, values, lines, path, notes)
    _check_duration(columns[0], times, lines, path)
    times, start = _started(times, start_sd_s, notes)
    series = {
        column.channel.name: _series(column, times, values[:, k], lines, limits, path, notes)
        for k, column in enumerate(columns[1:])
    }
    return Repeat(source.name, series, {}, tuple(notes), start, header.cells)


def _with_units(table: Table) -> Table:
    """The table with a second line of units, if there is one, moved into the header."""
    header, second = table.rows[0], table.rows[1]
    units = [cell.strip("[]() ") for cell in second.cells]
    named = [unit for unit in units if unit]
    if len(units) != len(header.cells) or any(unit_of(u) is None or is_number(u) for u in named):
        return table
    if not any(character.isalpha() for unit in named for character in unit):
        return table
    pairs = zip(header.cells, units, strict=True)
    cells = tuple(f"{name} [{unit}]" if name and unit else name for name, unit in pairs)
    note = "Units are in the second line of the header."
    return Table(table.separator, (Row(header.line, cells), *table.rows[2:]), (*table.notes, note))


def _check_chosen(source: Source, header: Row) -> None:
    for name in source.rows:
        if name not in header.cells:
            raise ConfigError(
                f"{source.path}, line {header.line}: rows are chosen by column {name!r}, which is "
                f"missing{nearest(name, [cell for cell in header.cells if cell])}"
            )


def _chosen_rows(source: Source, table: Table) -> list[Row]:
    header, rows = table.rows[0], list(table.rows[1:])
    for name, wanted in source.rows.items():
        index = header.cells.index(name)
        cells = [row.cells[index] if index < len(row.cells) else "" for row in rows]
        kept = [row for row, cell in zip(rows, cells, strict=True) if _is(cell, wanted)]
        if not kept:
            raise ConfigError(
                f"{source.path}: no row has {wanted!r} in column {name!r}"
                f"{nearest(str(wanted), list(dict.fromkeys(cells))[:50])}"
            )
        rows = kept
    if not rows:
        raise ConfigError(f"{source.path} has no samples; give at least 2 rows of numbers")
    return rows


def _is(cell: str, wanted: str | float) -> bool:
    if isinstance(wanted, str):
        return cell == wanted
    return is_number(cell) and number_of(cell, "") == wanted


def _extra_columns(table: Table, rows: Sequence[Row], layout: Layout, path: Path) -> list[str]:
    """What is said of cells without a header, and of columns that the case file leaves out."""
    header = table.rows[0].cells
    width = max(len(header), *(len(row.cells) for row in rows))
    bare = [i for i in range(width) if i >= len(header) or not header[i]]
    full = set()
    for row in rows:
        extra = [i for i in bare if i < len(row.cells) and row.cells[i]]
        full.update(extra)
        whole = table.separator == "," and not any("." in cell for cell in row.cells)
        if whole and any(row.cells[i].isdigit() for i in extra):
            raise ConfigError(
                f"{path}, line {row.line}: {len(row.cells)} cells, but the header names "
                f"{len(header) - header.count('')} columns; commas may be decimal signs here: "
                "separate columns by semicolons, or name every column"
            )
    short = sum(len(row.cells) < len(header) - _trailing(header) for row in rows)
    said = []
    if bare:
        held = f", {len(full)} of them with content" if full else ""
        said.append(f"{counted(len(bare), 'column')} without a header left out{held}.")
    if ignored := [cell for cell in header if cell in layout.ignore]:
        said.append(f"Columns left out as the case file asks: {', '.join(ignored)}.")
    if short:
        said.append(
            f"{counted(short, 'row')} shorter than the header; what is lacking counts as a gap."
        )
    return said


def _trailing(header: Sequence[str]) -> int:
    """Number of empty cells at the end of a header."""
    return next((i for i, cell in enumerate(reversed(header)) if cell), 0)


def _numbers(
    rows: Sequence[Row], columns: Sequence[Column], path: Path, notes: list[str]
) -> tuple[Array, Array, IntArray]:
    """Times (n,), values (n, channels) as written with nan for gaps, and lines (n,)."""
    cells = [
        [row.cells[c.index] if c.index < len(row.cells) else "" for c in columns] for row in rows
    ]
    numbered = ((row.line, cell) for row, line in zip(rows, cells, strict=True) for cell in line)
    if check_one_decimal_sign(numbered, str(path)):
        notes.append("Numbers have a decimal comma.")
    grid = np.array(
        [
            [
                number_of(cell, f"{path}, line {row.line}: {column.channel.name}")
                for cell, column in zip(line, columns, strict=True)
            ]
            for row, line in zip(rows, cells, strict=True)
        ]
    )
    lines = np.array([row.line for row in rows], dtype=np.int64)
    timed = np.isfinite(grid[:, 0])
    if not np.all(timed):
        left = counted(int(np.sum(~timed)), "row")
        notes.append(f"{left} without a time left out, the first in line {lines[~timed][0]}.")
    for k, column in enumerate(columns[1:], start=1):
        if gaps := int(np.sum(np.isnan(grid[timed, k]))):
            notes.append(f"{gaps} of {np.sum(timed)} values of {column.channel.name} are missing.")
    grid, lines = grid[timed], lines[timed]
    return grid[:, 0] * columns[0].unit.factor, grid[:, 1:], lines


def _ordered(
    times: Array, values: Array, lines: IntArray, path: Path, notes: list[str]
) -> tuple[Array, Array, IntArray]:
    """Increasing times: repeated ones are averaged, and time that goes back is refused."""
    back = np.flatnonzero(np.diff(times) < 0.0)
    if back.size:
        i = int(back[0])
        raise ConfigError(
            f"{path}, line {lines[i + 1]}: time = {times[i + 1]:g} s goes back from "
            f"{times[i]:g} s in line {lines[i]}; sort the rows, or choose the rows of one run "
            "with rows = { column = value } in the case file"
        )
    distinct, first, counts = np.unique(times, return_index=True, return_counts=True)
    if distinct.size < 2:
        line = lines[0] if lines.size else 1
        raise ConfigError(
            f"{path}, line {line}: there is {counted(distinct.size, 'time')} in all; give at "
            "least 2 rows of numbers"
        )
    if distinct.size == times.size:
        return times, values, lines
    there = np.isfinite(values)
    sums = np.add.reduceat(np.where(there, values, 0.0), first)
    numbers = np.add.reduceat(there.astype(float), first)
    with np.errstate(invalid="ignore"):
        means = sums / numbers
    at = int(np.argmax(counts > 1))
    notes.append(
        f"{counted(int(np.sum(counts > 1)), 'time stamp')} repeated, the first in line "
        f"{lines[first[at] + 1]}; values of equal time are averaged."
    )
    return distinct, means, lines[first]


def _check_duration(column: Column, times: Array, lines: IntArray, path: Path) -> None:
    """Refuse a duration far off that of the rig, if the rig gives one as the size of `time`."""
    if column.channel is not TIME:
        elapsed = (times[-1:] - times[0]) / column.unit.factor
        check_size(column.channel, elapsed, lines[-1:], column.unit, str(path))


def _started(times: Array, stated: float | None, notes: list[str]) -> tuple[Array, float]:
    """Times [s] and 1 sd of where time 0 lies in them [s]."""
    step = float(np.median(np.diff(times)))
    late = times[0] > LATE_STEPS * step or times[-1] < 0.0
    if stated is not None and math.isfinite(stated):
        return times, stated
    if stated is None and not late:
        if times[0] < 0.0:
            notes.append(f"Time begins {-times[0]:.4g} s before 0; the experiment starts at 0.")
        return times, step / math.sqrt(12.0)  # the start falls anywhere within a step
    if times[0] != 0.0:
        notes.append(
            f"Time begins at {times[0]:.6g} s; it is counted from the first sample, and the start "
            "of the experiment is unknown."
        )
    return times - times[0], math.inf


def _series(
    column: Column,
    times: Array,
    written: Array,
    lines: IntArray,
    limits: Limits,
    path: Path,
    notes: list[str],
) -> Series:
    channel, unit = column.channel, column.unit
    there = np.isfinite(written)
    if np.sum(there) < 2:
        raise ConfigError(
            f"{path}: column {column.header!r} holds {counted(int(np.sum(there)), 'value')}; give "
            "at least 2, or name the column under ignore in [csv]"
        )
    times, written, lines = times[there], written[there], lines[there]
    check_size(channel, written, lines, unit, str(path))
    values = written * unit.factor
    quantum = quality.quantum_of(written)
    _note_times(channel.name, times, notes)
    if np.ptp(written) == 0.0:
        notes.append(f"All values of {channel.name} are {written[0]:g} {unit.written}.")
    if quantum > COARSE * (np.max(written) - np.min(written)):
        notes.append(f"Values of {channel.name} come in steps of {quantum:.4g} {unit.written}.")
    if channel.name in limits:
        low, high = limits[channel.name]
        edge = 0.5 * quantum * unit.factor + 1e-9 * (high - low)
        clipped = (values <= low + edge) | (values >= high - edge)
        found = "the sensor's limits"
    else:
        clipped = quality.clipped_at(written, quantum, channel.unit)
        found = "clipped; if this is rest, state the sensor's limits"
    _note_clipped(channel.name, written, clipped, f"{unit.written} count as {found}", notes)
    return Series(channel.name, times, values, quantum * unit.factor, clipped)


def _note_times(name: str, times: Array, notes: list[str]) -> None:
    number, longest, begin = quality.gaps_in(times)
    if number:
        notes.append(
            f"{counted(number, 'gap')} in time of {name}; the longest lasts "
            f"{longest:.4g} s from {begin:.4g} s."
        )
    if not quality.is_regular(times):
        steps = np.diff(times)
        notes.append(f"Time steps of {name} vary from {steps.min():.4g} to {steps.max():.4g} s.")


def _note_clipped(
    name: str, written: Array, clipped: BoolArray, said: str, notes: list[str]
) -> None:
    if np.any(clipped):
        low, high = written[clipped].min(), written[clipped].max()
        ends = f"{low:g}" if low == high else f"{low:g} and {high:g}"
        notes.append(f"{counted(int(np.sum(clipped)), 'value')} of {name} at {ends} {said}.")
