"""Compilation of the kernel: once per machine, kept in the user's cache.

Each kept file begins with a digest of the rest. A file that was cut or changed is deleted and its
function compiled again: machine code that is not whole ends the process where it is loaded.
"""

import contextlib
import fcntl
import functools
import hashlib
import logging
import os
import pickle
import shutil
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import _Cache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from mfopt.errors import ConfigError
from mfopt.files.cache import cache_directory
from mfopt.files.whole import write_aside

# Reordering and fused operations, but numbers that are not finite keep their meaning: the
# engine looks for them. Nothing is allocated in the kernel, so that arrays need no counting of
# references (`_nrt`), which took half of the time.
OPTIONS: dict[str, Any] = {
    "fastmath": {"contract", "arcp", "nsz", "reassoc"},
    "error_model": "numpy",
    "_nrt": False,
}
EXACT = {key: value for key, value in OPTIONS.items() if key != "fastmath"}

KEPT_S = 30 * 86400.0  # [s] compiled code of other sources is kept so long after its last use

log = logging.getLogger(__name__)


@functools.cache
def code_directory(cache: Path) -> Path:
    """Where code compiled from the present sources is kept: its name holds their digest.

    Every function is compiled into others, so that a change of one file changes the code of all.
    """
    sources = [p.read_bytes() for p in sorted(Path(__file__).parent.glob("*.py"))]
    versions = f"{numba.__version__} {sys.implementation.cache_tag}"
    digest = hashlib.sha256(b"".join(sources) + versions.encode()).hexdigest()[:16]
    directory = cache / "compiled" / digest
    with contextlib.suppress(OSError):  # said when code is to be kept there
        keep_in_use(directory)
    return directory


def keep_in_use(directory: Path) -> None:
    """Note that `directory` is in use, and remove its neighbours that have long been out of use.

    Under a lock, so that nobody removes what another process is just taking into use.
    """
    directory.mkdir(parents=True, exist_ok=True)
    with (directory.parent / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        os.utime(directory)
        for other in [path for path in directory.parent.iterdir() if path.is_dir()]:
            if other.stat().st_mtime < time.time() - KEPT_S:
                shutil.rmtree(other, ignore_errors=True)


def compiled(function: Callable[..., Any]) -> Any:
    """Compile `function` when it is first called, and keep the result for other processes."""
    dispatcher = numba.njit(**OPTIONS)(function)
    dispatcher._cache = KeptCode(function)
    return dispatcher


def compiled_exactly(function: Callable[..., Any]) -> Any:
    """As `compiled`, without reordering or fusing: the numbers are those of Python to the bit."""
    dispatcher = numba.njit(**EXACT)(function)
    dispatcher._cache = KeptCode(function)
    return dispatcher


def inlined(function: Callable[..., Any]) -> Any:
    """Compile `function` into its callers."""
    return numba.njit(forceinline=True, **OPTIONS)(function)


class KeptCode(_Cache):
    """The compiled code of one function, a file for each type of arguments."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._name = f"{function.__module__}.{function.__qualname__}"

    @property
    def cache_path(self) -> str:
        """Where the files are."""
        return str(code_directory(cache_directory()))

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The kept code for arguments of the types `sig`, or None if none is whole."""
        target_context.refresh()
        content = read_kept(self._file(sig, target_context.codegen()))
        if content is None:
            return None
        parts = pickle.loads(content)
        return CompileResult._rebuild(target_context, *parts)  # type: ignore[no-untyped-call]

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the compile result `data`."""
        content = dumps(data._reduce())  # type: ignore[no-untyped-call]
        keep(self._file(sig, data.codegen), content)

    def _file(self, sig: Any, codegen: Any) -> Path:
        """The file of a signature and of a processor, whose properties the code uses."""
        what = repr((self._name, sig, codegen.magic_tuple()))
        name = hashlib.sha256(what.encode()).hexdigest()[:16]
        return Path(self.cache_path) / f"{self._name.rpartition('.')[2]}-{name}.code"

    def enable(self) -> None:
        """Always enabled."""

    def disable(self) -> None:
        """Always enabled."""

    def flush(self) -> None:
        """Nothing is held back."""


def read_kept(path: Path) -> bytes | None:
    """What `keep` wrote to `path`; None if nothing is there. What is not whole is deleted."""
    try:
        content = path.read_bytes()
    except OSError:
        return None
    size = hashlib.sha256().digest_size
    if hashlib.sha256(content[size:]).digest() == content[:size]:
        return content[size:]
    log.warning("%s is damaged, and its function is compiled again", path)
    with contextlib.suppress(OSError):
        path.unlink()
    return None


def keep(path: Path, content: bytes) -> None:
    """Write `content` and its digest to `path`; a disk that takes nothing stops no run."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_aside(path, hashlib.sha256(content).digest() + content)
    except (ConfigError, OSError) as error:
        log.debug("%s", error)
        _tell_not_kept(path.parent)


@functools.cache
def _tell_not_kept(directory: Path) -> None:
    log.warning(
        "compiled code cannot be kept in %s, and every process compiles it; free some space there, "
        "or set XDG_CACHE_HOME to a directory that can be written", directory,
    )  # fmt: skip
