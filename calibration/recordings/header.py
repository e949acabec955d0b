"""The header of a recording: which column holds which channel, and in which unit."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from calibration.recordings.text import Row
from calibration.recordings.units import FRAMES, Unit, unit_of, units_like
from mfopt.errors import ConfigError
from mfopt.records.rig import Channel
from mfopt.settings import nearest

TIMES = ("time", "t")

# Quantity and unit: "level [mm]", "level (mm)".
_BRACKETS = (
    re.compile(r"^(?P<name>.+?)\s*\[\s*(?P<unit>[^\]]*?)\s*\]$"),
    re.compile(r"^(?P<name>.+?)\s*\(\s*(?P<unit>[^)]*?)\s*\)$"),
)
# "level / mm", "level in mm", "level_mm", "level mm"; only where the name is known.
_ENDINGS = (
    re.compile(r"^(?P<name>.+?)\s*/\s*(?P<unit>\S+)$"),
    re.compile(r"^(?P<name>.+?)\s+in\s+(?P<unit>\S+)$"),
    re.compile(r"^(?P<name>.+)[_ ](?P<unit>[^\s_]+)$"),
)


@dataclass(frozen=True, slots=True)
class Layout:
    """How the files of a case are laid out, where their headers do not say it themselves."""

    rename: Mapping[str, str] = field(default_factory=dict)  # header as written -> as it should be
    ignore: Sequence[str] = ()  # headers of columns that are left out
    frames_per_s: float | None = None  # [Hz] if time is counted in frames


@dataclass(frozen=True, slots=True)
class Column:
    """A column that is read."""

    index: int
    header: str  # as written
    channel: Channel
    unit: Unit


TIME = Channel("time", "s", 1.0)  # where the rig gives no usual duration; not checked then


def columns_of(
    header: Row,
    channels: Mapping[str, Channel],
    layout: Layout,
    chosen_by: Sequence[str],
    where: str,
) -> tuple[Column, ...]:
    """The columns that are read, the time first.

    Args:
        header: first row of the file.
        channels: that the rig has, by name.
        layout: what the case file says of the columns.
        chosen_by: headers of columns that only choose rows.
        where: file and line, for messages.

    Raises:
        ConfigError: for an unknown channel or unit, a column given twice, or no time.
    """
    if not any(re.search(r"[^\W\d_]", cell) for cell in header.cells):
        raise ConfigError(
            f"{where}: the first row {', '.join(header.cells)[:60]!r} names no quantity; put a "
            "header above it, such as 'time [s]; level [mm]'"
        )
    found: dict[str, Column] = {}
    for index, cell in enumerate(header.cells):
        if not cell or cell in layout.ignore or cell in chosen_by:
            continue
        column = _column(index, layout.rename.get(cell, cell), channels, layout, where)
        name = column.channel.name
        if name in found:
            raise ConfigError(
                f"{where}: columns {found[name].index + 1} and {index + 1} both hold {name!r}; "
                "keep one, and name the other under ignore in [csv]"
            )
        found[name] = column
    if "time" not in found:
        raise ConfigError(
            f"{where}: no column holds the time; call one 'time [s]', or rename it in [csv]"
        )
    if len(found) < 2:
        raise ConfigError(
            f"{where}: no column beside the time; give one of {', '.join(sorted(channels))}"
        )
    return (found.pop("time"), *found.values())


def plain_name(text: str) -> str:
    """A name as the rig writes it: lower case, underscores."""
    return re.sub(r"[\s\-]+", "_", text.strip().lower())


def _column(
    index: int, text: str, channels: Mapping[str, Channel], layout: Layout, where: str
) -> Column:
    name, written = _split(text, channels)
    is_time = name in (*TIMES, *FRAMES)
    channel = channels.get(TIME.name, TIME) if is_time else channels.get(name)
    if channel is None:
        raise ConfigError(
            f"{where}: the rig has no channel {name!r}{_hint(name, channels)} "
            "A column that is not needed is named under ignore in [csv]."
        )
    if is_time and (name in FRAMES or written in FRAMES):
        return Column(index, text, channel, _frames(layout, where))
    if written is None:
        raise ConfigError(
            f"{where}: column {text!r} has no unit; write '{text} [{channel.unit}]', or another "
            f"unit of {', '.join(units_like(channel.unit)[:6])}"
        )
    return Column(index, text, channel, unit_for(channel, written, f"{where}: column {text!r}"))


def unit_for(channel: Channel, written: str, where: str) -> Unit:
    """The unit that is written, if it is one of the channel.

    Raises:
        ConfigError: if there is no such unit, or it measures something else.
    """
    if written == channel.unit:
        return Unit(written, 1.0, channel.unit)
    unit = unit_of(written)
    if unit is None:
        raise ConfigError(
            f"{where}: unknown unit {written!r}; {channel.name} can be in "
            f"{', '.join(units_like(channel.unit)) or channel.unit}"
        )
    if unit.si != channel.unit:
        raise ConfigError(
            f"{where}: unit {written!r} does not measure {channel.name}, which can be in "
            f"{', '.join(units_like(channel.unit)) or channel.unit}; correct unit or name"
        )
    return unit


def _split(text: str, channels: Mapping[str, Channel]) -> tuple[str, str | None]:
    """Name and unit of a header; no unit if it names none."""
    for pattern in _BRACKETS:
        if match := pattern.match(text):
            return plain_name(match["name"]), match["unit"]
    if (name := plain_name(text)) in channels:
        return name, None
    for pattern in _ENDINGS:
        match = pattern.match(text)
        if match is None or plain_name(match["name"]) not in (*channels, *TIMES):
            continue
        if unit_of(match["unit"]) or match["unit"] in FRAMES:
            return plain_name(match["name"]), match["unit"]
    return name, None


def _frames(layout: Layout, where: str) -> Unit:
    if layout.frames_per_s is None:
        raise ConfigError(
            f"{where}: time is counted in frames; say under [csv] how many make a second, such as "
            "frames_per_s = 240"
        )
    return Unit("frames", 1.0 / layout.frames_per_s, "s")


def _hint(name: str, channels: Mapping[str, Channel]) -> str:
    """The nearest channel; or that the end of the name, after a channel, is no known unit."""
    for channel in (*channels, *TIMES):
        if re.match(rf"{re.escape(channel)}[_/]", name):
            end = name[len(channel) + 1 :]
            return f"; did you mean {channel!r}? {end!r} is no known unit."
    close = nearest(name, [*channels, "time"])
    return f"{close}{'' if close.endswith('?') else '.'}"
