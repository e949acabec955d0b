"""Folders in TMPDIR for the files of one run or report, removed at its end.

A folder is locked by its process, and the kernel takes the lock away when that dies. So what a
killed process left is told from what another one uses, and the next process removes it.
"""

import contextlib
import fcntl
import functools
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from mfopt.errors import ConfigError
from mfopt.files.whole import disk_errors_named

PREFIX = "mfopt-scratch-"
TRIES = 100  # at a folder that nobody else removes before it is locked


def temporary_directory() -> Path:
    """Where temporary files go: `$TMPDIR`, or what the system has for it.

    Raises:
        ConfigError: if there is none that can be written.
    """
    try:
        return Path(tempfile.gettempdir())
    except FileNotFoundError as error:
        raise ConfigError(
            "no temporary directory can be written; set TMPDIR to one that can"
        ) from error


@contextlib.contextmanager
def scratch() -> Iterator[Path]:
    """A new folder; the first in a process removes those of this user's dead processes.

    Raises:
        ConfigError: if none can be made.
    """
    temporary = temporary_directory()
    remove_leftovers(temporary)
    with contextlib.ExitStack() as stack:
        for _ in range(TRIES):
            with disk_errors_named(temporary, "write"):
                folder = tempfile.TemporaryDirectory(prefix=PREFIX, ignore_cleanup_errors=True)
            stack.enter_context(folder)
            try:
                if _locked(Path(folder.name), stack):
                    break
            except FileNotFoundError:
                continue  # removed before it was locked
            except OSError:
                break  # no such locks here: nobody removes it either
        yield Path(folder.name)


@functools.cache
def remove_leftovers(temporary: Path) -> None:
    """Remove the folders of this user whose processes are dead; once in a process."""
    for path in temporary.glob(f"{PREFIX}*"):
        with contextlib.suppress(OSError), contextlib.ExitStack() as stack:
            if path.lstat().st_uid == os.geteuid() and _locked(path, stack):
                shutil.rmtree(path, ignore_errors=True)


def _locked(path: Path, stack: contextlib.ExitStack) -> bool:
    """Lock a folder until the stack is left; False if it is another's, or gone.

    Raises:
        OSError: if it is not there, or cannot be locked at all.
    """
    number = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    stack.callback(os.close, number)
    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return path.exists()
