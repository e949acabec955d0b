"""The journal of a run: one JSON object a line, appended, flushed and synced.

Each line begins with a check, the digest of the check before it and of its own text. So a line
that was changed, removed, repeated or moved does not fit, and a journal fits one run only.
A torn last line, all that a killed writer can leave, is no line.
"""

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mfopt.errors import ConfigError
from mfopt.files.array_file import digest
from mfopt.files.whole import disk_errors_named

HEAD = '{"check": "'


@dataclass(frozen=True, slots=True)
class Line:
    """A line of the journal, and where it stands."""

    number: int  # counted from 1
    begins: int  # [bytes]
    record: dict[str, Any]


@dataclass(slots=True)
class Journal:
    """The journal at `path`, read and appended to.

    Args:
        check: of the line last read or written; to begin with, what tells the run from others.
    """

    path: Path
    check: str

    def read(self) -> Iterator[Line]:
        """All lines, each checked, and the check of the last noted.

        Raises:
            ConfigError: if the file cannot be read, or a line does not fit.
        """
        begins = 0
        with disk_errors_named(self.path, "read"), open(self.path, "rb") as file:
            for number, text in enumerate(file, start=1):
                if not text.endswith(b"\n"):
                    return
                check, record = _parts(text)
                if check != digest(self.check.encode() + record):
                    raise self.damaged(
                        number, "it was changed, or a line before it was removed, repeated or moved"
                    )
                try:
                    yield Line(number, begins, json.loads(record))
                except (ValueError, RecursionError) as error:
                    raise self.damaged(number, "it is no JSON") from error
                self.check = check
                begins += len(text)

    def append(self, record: Mapping[str, Any]) -> int:
        """Append a line; return where it begins [bytes].

        Raises:
            ConfigError: if the disk refuses it.
        """
        text = json.dumps(record, allow_nan=False).encode()
        check = digest(self.check.encode() + text)
        line = f'{HEAD}{check}", '.encode() + text[1:] + b"\n"
        with disk_errors_named(self.path, "write"), open(self.path, "ab") as file:
            file.write(line)
            file.flush()
            os.fsync(file.fileno())
            ends = file.tell()
        self.check = check
        return ends - len(line)

    def record_at(self, begins: int) -> dict[str, Any]:
        """Read once more the line that begins there.

        Raises:
            ConfigError: if it is not there any more.
        """
        with disk_errors_named(self.path, "read"), open(self.path, "rb") as file:
            file.seek(begins)
            text = file.readline()
        try:
            record: dict[str, Any] = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise ConfigError(f"{self.path} was changed while it was read; start again") from error
        return record

    def drop_torn_line(self) -> None:
        """Cut off what a killed writer began and did not end.

        Raises:
            ConfigError: if the disk refuses it.
        """
        with disk_errors_named(self.path, "write"), open(self.path, "r+b") as file:
            if file.seek(0, os.SEEK_END) == 0:
                return
            file.seek(-1, os.SEEK_END)
            if file.read() != b"\n":
                file.seek(0)
                file.truncate(file.read().rfind(b"\n") + 1)

    def damaged(self, number: int, why: str) -> ConfigError:
        """What to say of a line that does not fit."""
        return ConfigError(
            f"{self.path}, line {number} is damaged: {why}; restore the file, or keep its first "
            f"{number - 1} lines and resume: what came after them is run again"
        )


def _parts(text: bytes) -> tuple[str, bytes]:
    """The check of a line, and the record that it is of."""
    begins = len(HEAD) + 32
    return text[len(HEAD) : begins].decode("latin-1"), b"{" + text[begins + 3 : -1]
