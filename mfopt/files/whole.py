"""Writing files so that they are whole or absent, with errors of the disk named."""

import contextlib
import errno
import os
import re
from collections.abc import Iterator
from pathlib import Path

from mfopt.errors import ConfigError

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
ASIDE = re.compile(r"\.(?P<name>.+)\.(?P<pid>\d+)")  # what `write_aside` writes before it renames


@contextlib.contextmanager
def full_disk_named(path: Path) -> Iterator[None]:
    """Turn "no space left" into a message that says where and what to do."""
    try:
        yield
    except OSError as error:
        if error.errno not in FULL:
            raise
        raise ConfigError(
            f"no disk space left for {path}; free some and continue with --resume"
        ) from error


@contextlib.contextmanager
def disk_errors_named(path: Path, doing: str) -> Iterator[None]:
    """Turn any error of the disk into one line that says where and what to do.

    Args:
        doing: what is done with `path`, "read", "write" or "lock".
    """
    with full_disk_named(path):
        try:
            yield
        except OSError as error:
            if error.errno in FULL:
                raise
            why = error.strerror or str(error)
            raise ConfigError(
                f"cannot {doing} {path}: {why}; mend that, then start again (a run with --resume)"
            ) from error


def write_aside(path: Path, content: bytes) -> None:
    """Write a file so that it is either whole or absent, whenever the writer is killed.

    Raises:
        ConfigError: if the disk refuses it.
    """
    aside = path.with_name(f".{path.name}.{os.getpid()}")
    with disk_errors_named(path, "write"):
        try:
            with open(aside, "wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            aside.replace(path)
            _sync_folder(path.parent)
        finally:
            with contextlib.suppress(OSError):
                aside.unlink(missing_ok=True)


def _sync_folder(folder: Path) -> None:
    """Make names in a folder last over a power cut, where the file system can."""
    with contextlib.suppress(OSError):
        number = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(number)
        finally:
            os.close(number)
