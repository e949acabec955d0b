"""Compilation of the kernel: once per machine, kept in the user's cache."""

import contextlib
import fcntl
import hashlib
import os
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

# Reordering and fused operations, but numbers that are not finite keep their meaning: the
# engine looks for them. Nothing is allocated in the kernel, so that arrays need no counting of
# references (`_nrt`), which took half of the time.
OPTIONS: dict[str, Any] = {
    "fastmath": {"contract", "arcp", "nsz", "reassoc"},
    "error_model": "numpy",
    "_nrt": False,
}


KEPT_S = 30 * 86400.0  # [s] compiled code of other sources is kept so long after its last use


def cache_directory() -> Path:
    """Where compiled code is kept: below `$XDG_CACHE_HOME/mfopt`, or `~/.cache/mfopt`.

    Its name holds a digest of all sources of the kernel: Numba itself looks only at the file of
    the function that it loads, not at those of the functions that are compiled into it.
    """
    base = os.environ.get("XDG_CACHE_HOME")
    sources = b"".join(p.read_bytes() for p in sorted(Path(__file__).parent.glob("*.py")))
    digest = hashlib.sha256(sources + numba.__version__.encode()).hexdigest()[:16]
    return (Path(base) if base else Path.home() / ".cache") / "mfopt" / "compiled" / digest


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


_DIRECTORY = str(cache_directory())
with contextlib.suppress(OSError):  # a cache that cannot be written is Numba's to report
    keep_in_use(Path(_DIRECTORY))
_settings: Any = numba.config


def compiled(function: Callable[..., Any]) -> Any:
    """Compile `function` when it is first called, and keep the result for other processes."""
    usual = _settings.CACHE_DIR
    _settings.CACHE_DIR = _DIRECTORY
    try:
        return numba.njit(cache=True, **OPTIONS)(function)
    finally:
        _settings.CACHE_DIR = usual


def inlined(function: Callable[..., Any]) -> Any:
    """Compile `function` into its callers."""
    return numba.njit(forceinline=True, **OPTIONS)(function)
