"""Compilation of the kernel: once per machine, kept in the user's cache."""

import hashlib
import os
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


def cache_directory() -> Path:
    """Where compiled code is kept: below `$XDG_CACHE_HOME/mfopt`, or `~/.cache/mfopt`.

    Its name holds a digest of all sources of the kernel: Numba itself looks only at the file of
    the function that it loads, not at those of the functions that are compiled into it.
    """
    base = os.environ.get("XDG_CACHE_HOME")
    sources = b"".join(p.read_bytes() for p in sorted(Path(__file__).parent.glob("*.py")))
    digest = hashlib.sha256(sources + numba.__version__.encode()).hexdigest()[:16]
    return (Path(base) if base else Path.home() / ".cache") / "mfopt" / "compiled" / digest


_DIRECTORY = str(cache_directory())
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
