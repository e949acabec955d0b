"""Makes one write of a Python process fail. Loaded by Python itself at its start.

`MFOPT_FAULT` is a JSON object: `role` ("main" or "worker"), `number` of the write that fails,
counted from 1, `errno`, and `told`, a file into which the write that failed is written as a line.
Of several workers only the first that gets there fails. If `number` is 0, none fails, and every
write is a line in the file `told.main` or `told.worker`.

A write is: to open a regular file for writing, each write that reaches the operating system,
fsync, truncate, replace, rename, link and mkdir. What C libraries write by themselves is not seen.
"""

import builtins
import io
import json
import os
import stat
import sys
from typing import Any

FAULT = json.loads(os.environ.get("MFOPT_FAULT", "null"))
ROLE = "worker" if "--multiprocessing-fork" in sys.orig_argv else "main"
_open, _os_open, _write, _close = io.open, os.open, os.write, os.close
_count = 0


def _tick(what: str, path: object) -> None:
    global _count
    count_only = FAULT["number"] == 0
    if FAULT["role"] != ROLE and not count_only:
        return
    _count += 1
    if FAULT["number"] not in (0, _count):
        return
    flags = os.O_WRONLY | os.O_CREAT | (os.O_APPEND if count_only else os.O_EXCL)
    try:
        told = _os_open(FAULT["told"] + f".{ROLE}" * count_only, flags, 0o644)
    except FileExistsError:  # another worker's has failed already
        return
    _write(told, f"{what} {path}\n".encode())
    _close(told)
    if not count_only:
        raise OSError(FAULT["errno"], os.strerror(FAULT["errno"]), str(path))


class _File(io.FileIO):
    """A file whose writes are counted."""

    def write(self, data: Any, /) -> int:
        _tick("write", self.name)
        return super().write(data) or 0

    def truncate(self, size: int | None = None, /) -> int:
        _tick("truncate", self.name)
        return super().truncate(size)


def _counted_open(
    file: Any, mode: str = "r", buffering: int = -1, encoding: str | None = None,
    errors: str | None = None, newline: str | None = None, closefd: bool = True, opener: Any = None,
) -> Any:  # fmt: skip
    if isinstance(file, int) or not set(mode) & set("wax+") or _special(file):
        return _open(file, mode, buffering, encoding, errors, newline, closefd, opener)
    _tick("open", file)
    raw = _File(file, mode.replace("b", "").replace("t", ""), closefd, opener)
    if buffering == 0:
        return raw
    binary = io.BufferedRandom(raw) if "+" in mode else io.BufferedWriter(raw)
    return binary if "b" in mode else io.TextIOWrapper(binary, encoding, errors, newline)


def _special(path: Any) -> bool:
    try:
        return not stat.S_ISREG(os.stat(path).st_mode)
    except OSError:
        return False


def _counted(name: str, which: int = 0) -> None:
    """Count the calls of `os.name`; its argument `which` says on what."""
    function = getattr(os, name)

    def counted(*args: Any, **kwargs: Any) -> Any:
        _tick(name, args[which] if args else "")
        return function(*args, **kwargs)

    setattr(os, name, counted)


def _counted_os_open(path: Any, flags: int, *args: Any, **kwargs: Any) -> int:
    if flags & (os.O_WRONLY | os.O_RDWR) and not _special(path):
        _tick("open", path)
    return _os_open(path, flags, *args, **kwargs)


def _counted_write(fd: int, data: Any) -> int:
    if stat.S_ISREG(os.fstat(fd).st_mode):
        _tick("write", f"descriptor {fd}")
    return _write(fd, data)


if FAULT is not None:
    builtins.open = io.open = _counted_open
    os.open, os.write = _counted_os_open, _counted_write
    for called in ("fsync", "ftruncate", "truncate", "mkdir"):
        _counted(called)
    for called in ("replace", "rename", "link", "symlink"):
        _counted(called, 1)
