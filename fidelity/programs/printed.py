"""What a function of the user's prints: kept from the screen, for the reason of a failed run."""

import io
import os
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from typing import IO, Any

LAST_LINES = 20  # of what was printed, that a reason has
LAST_BYTES = 8192  # looked at to find them
MOST_BYTES = 2**20  # kept of what Python prints
STANDARD = (1, 2)  # file descriptors of output and errors


@contextmanager
def captured() -> Iterator[Callable[[], str]]:
    """Keep what is printed within from the screen; gives the last lines of it, if any.

    What compiled code and child processes print is kept as well. In a thread other than the main
    one nothing is: output belongs to all of a process.
    """
    if threading.current_thread() is not threading.main_thread():
        yield str
        return
    number = os.memfd_create("mfopt-printed")
    with os.fdopen(number, "r+b", buffering=0):
        stream = io.TextIOWrapper(
            io.BufferedWriter(_Kept(number)), "utf-8", "backslashreplace", line_buffering=True
        )
        with stream, _standard_onto(number), redirect_stdout(stream), redirect_stderr(stream):

            def last_lines() -> str:
                stream.flush()
                _flush()
                lines = _tail(number, LAST_BYTES).decode("utf-8", "replace").splitlines()
                said = "\n".join(lines[-LAST_LINES:]).strip()
                return f"; the last lines that it printed:\n{said}" if said else ""

            yield last_lines


class _Kept(io.RawIOBase):
    """A file in memory of which only the end is kept."""

    def __init__(self, number: int) -> None:
        self._number = number

    def writable(self) -> bool:
        return True

    def fileno(self) -> int:
        return self._number

    def write(self, data: Any) -> int:
        os.lseek(self._number, 0, os.SEEK_END)
        written = os.write(self._number, data)
        if os.fstat(self._number).st_size > MOST_BYTES:
            end = _tail(self._number, LAST_BYTES)
            os.ftruncate(self._number, 0)
            os.pwrite(self._number, end, 0)
            os.lseek(self._number, 0, os.SEEK_END)
        return written


def _tail(number: int, most: int) -> bytes:
    size = os.fstat(number).st_size
    return os.pread(number, most, max(0, size - most))


@contextmanager
def _standard_onto(number: int) -> Iterator[None]:
    """Let standard output and errors of the process be this file."""
    _flush()
    usual: list[tuple[int, int]] = []
    for standard in STANDARD:
        with suppress(OSError):  # this process was started without it
            usual.append((standard, os.dup(standard)))
            os.dup2(number, standard)
    try:
        yield
    finally:
        _flush()
        for standard, kept in usual:
            os.dup2(kept, standard)
            os.close(kept)


def _flush() -> None:
    """Write what Python's own streams still hold."""
    streams: tuple[IO[str] | None, ...] = (sys.__stdout__, sys.__stderr__)
    for stream in streams:
        with suppress(OSError, ValueError):  # gone, or closed
            if stream is not None:
                stream.flush()
