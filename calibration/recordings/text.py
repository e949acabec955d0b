"""The text of a recording: decoded, split into rows, with the line of each row."""

import csv
import gzip
import stat
import zlib
from dataclasses import dataclass
from pathlib import Path

from mfopt.errors import ConfigError

MOST_BYTES = 200_000_000  # of a recording, unpacked; ten channels at 1 kHz fill it in half an hour
COMMENTS = ("#", "%", "//")
SEPARATORS = {"\t": "tabs", ";": "semicolons", ",": "commas"}  # in the order of preference

_MARKS = (
    (b"\xef\xbb\xbf", "utf-8"),
    (b"\xff\xfe", "utf-16-le"),
    (b"\xfe\xff", "utf-16-be"),
)


@dataclass(frozen=True, slots=True)
class Row:
    """The cells of one line."""

    line: int  # counted from 1, as editors do
    cells: tuple[str, ...]  # without surrounding spaces


@dataclass(frozen=True, slots=True)
class Table:
    """A file split into cells; the first row is the header."""

    separator: str
    rows: tuple[Row, ...]
    notes: tuple[str, ...]


def read_table(path: Path) -> Table:
    """Read a file of separated values.

    Raises:
        ConfigError: if it cannot be opened or decoded, is far too large, or has no rows.
    """
    text, notes = _decoded(_bytes(path), path)
    lines = [(i, line.strip(" \ufeff")) for i, line in enumerate(text.split("\n"), start=1)]
    separator, lines = _declared_separator(lines)
    blank = [i for i, line in lines if not line.strip(" \t;,") and i < len(lines)]
    comments = [i for i, line in lines if line.lstrip().startswith(COMMENTS)]
    kept = [
        (i, line)
        for i, line in lines
        if line.strip(" \t;,") and not line.lstrip().startswith(COMMENTS)
    ]
    if len(kept) < 2:
        what = "is empty" if not kept else f"has a header in line {kept[0][0]} and no samples"
        raise ConfigError(f"{path} {what}; give a header and at least 2 rows of numbers")
    if commented := _commented_header(lines, kept[0][0]):
        kept.insert(0, commented)
        comments.remove(commented[0])
        notes.append("The header is a comment.")
    separator = separator or _separator(kept[0][1], path, kept[0][0])
    for count, kind in ((len(blank), "blank"), (len(comments), "comment")):
        if count:
            notes.append(f"{counted(count, kind + ' line')} left out.")
    if separator != ",":
        notes.append(f"Columns are separated by {SEPARATORS[separator]}.")
    rows = tuple(Row(i, _cells(line, separator)) for i, line in kept)
    return Table(separator, rows, tuple(notes))


def counted(number: int, noun: str) -> str:
    """Such as "1 line" or "3 lines"."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def _bytes(path: Path) -> bytes:
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise ConfigError(f"cannot read recording {path}: it is not a file; give a CSV file")
        with path.open("rb") as file:
            packed = path.suffix == ".gz"
            content = (gzip.GzipFile(fileobj=file) if packed else file).read(MOST_BYTES + 1)
    except FileNotFoundError as error:
        raise ConfigError(
            f"recording {path} does not exist; file names count from the folder of the case file"
        ) from error
    except (OSError, EOFError, zlib.error) as error:
        raise ConfigError(f"cannot read recording {path}: {error}; save it again") from error
    if len(content) > MOST_BYTES:
        raise ConfigError(
            f"recording {path} has more than the limit of {MOST_BYTES / 1e6:.0f} MB; "
            "leave out samples or columns"
        )
    return content


def _decoded(content: bytes, path: Path) -> tuple[str, list[str]]:
    encoding, notes = "utf-8", []
    for mark, marked in _MARKS:
        if content.startswith(mark):
            content, encoding = content[len(mark) :], marked
            notes.append("A byte-order mark was left out.")
            break
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise ConfigError(
            f"{path}, line {line}: byte 0x{content[error.start]:02x} is not {encoding.upper()}; "
            "save the file as UTF-8"
        ) from error
    if "\x00" in text:
        line = text[: text.index("\x00")].count("\n") + 1
        raise ConfigError(
            f"{path}, line {line}: the file holds zero bytes, so it is no text in UTF-8; "
            "save it as CSV in UTF-8"
        )
    return text.replace("\r\n", "\n").replace("\r", "\n"), notes


def _declared_separator(
    lines: list[tuple[int, str]],
) -> tuple[str | None, list[tuple[int, str]]]:
    """The separator of a first line such as `sep=;`, which spreadsheets write, and the rest."""
    first = lines[0][1].replace(" ", "").lower()
    if first.startswith("sep=") and first[4:] in SEPARATORS:
        return first[4:], lines[1:]
    return None, lines


def _commented_header(lines: list[tuple[int, str]], first: int) -> tuple[int, str] | None:
    """The comment in front of line `first` as a header, if that line holds numbers alone."""
    texts = dict(lines)
    above = texts.get(first - 1, "").lstrip()
    if any(character.isalpha() for character in texts[first]) or not above.startswith(COMMENTS):
        return None
    return first - 1, above.lstrip("#%/ ")


def _separator(header: str, path: Path, line: int) -> str:
    for separator in SEPARATORS:
        if len(_cells(header, separator)) > 1:
            return separator
    raise ConfigError(
        f"{path}, line {line}: the header {header[:60]!r} is one column; give a column of time and "
        "one of values, separated by commas, semicolons or tabs"
    )


def _cells(line: str, separator: str) -> tuple[str, ...]:
    """The cells of one line; quotes end with the line."""
    (cells,) = csv.reader([line], delimiter=separator, skipinitialspace=True)
    return tuple(cell.strip() for cell in cells)
