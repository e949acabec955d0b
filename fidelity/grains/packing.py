"""Settled packings: made once, kept in a cache, and checked before every use.

A packing is found by the digest of everything that it depends on. A file that is damaged or
fails the check is made again. Of several processes that want the same packing one makes it,
the others wait.
"""

import contextlib
import fcntl
import hashlib
import json
import logging
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from fidelity.engine import Engine, Packing
from mfopt.arrays import AnyArray, frozen
from mfopt.errors import ConfigError
from mfopt.files.array_file import read_arrays, write_arrays
from mfopt.files.cache import cache_directory

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, eq=False)
class Settled:
    """A packing at rest, and what it cost."""

    packing: Packing
    cpu_s: float = 0.0  # spent on it now; 0 if it came from the cache
    work: float = 0.0  # likewise [sphere-steps times the engine's cost factor]


class Filling(Protocol):
    """How a vessel is filled. Must be picklable."""

    def described(self) -> dict[str, Any]:
        """All that the packing depends on, besides the engine; arrays and what JSON can hold."""

    def settle(self, engine: Engine, time_limit_s: float) -> Settled:
        """Fill the vessel.

        Raises:
            SimulationError: if the grains cannot be settled; the message says what happened.
        """

    def flaw(self, packing: Packing) -> str | None:
        """Why a packing from the cache cannot be used, or None."""


def default_cache() -> Path:
    """Where settled packings are kept: in the user's cache.

    Raises:
        ConfigError: if no cache takes files.
    """
    return cache_directory() / "packings"


def settled_packing(
    engine: Engine, filling: Filling, cache: Path, *, time_limit_s: float
) -> Settled:
    """Take the packing from the cache, or settle it with `engine` and keep it.

    Raises:
        SimulationError: if the grains cannot be settled; the message says what happened.
    """
    path = cache / f"{digest(engine, filling)}.h5"
    kept = _read(path, filling)
    if kept is not None:
        return Settled(kept)
    with _only_one(path.with_suffix(".lock")):
        kept = _read(path, filling)  # another process may have made it meanwhile
        if kept is not None:
            return Settled(kept)
        made = filling.settle(engine, time_limit_s)
        try:
            write_arrays(path, _with_checksum(made.packing))
        except ConfigError as error:  # it serves this run all the same
            log.warning("a settled packing cannot be kept, and is made again: %s", error)
        return made


def digest(engine: Engine, filling: Filling) -> str:
    """Digest of engine, its version and the filling: the packing's name in the cache."""
    program = [engine.name, repr(engine), engine.version()]  # repr: all of the engine's fields
    what = {"engine": program, **filling.described()}
    text = json.dumps(what, sort_keys=True, default=_as_list)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def _as_list(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else str(value)


def _with_checksum(packing: Packing) -> dict[str, AnyArray]:
    arrays = {"positions": packing.positions, "orientations": packing.orientations}
    if packing.scales is not None:
        arrays["scales"] = packing.scales
    return {**arrays, "checksum": _checksum(packing)}


def _checksum(packing: Packing) -> AnyArray:
    content = packing.positions.tobytes() + packing.orientations.tobytes()
    if packing.scales is not None:
        content += packing.scales.tobytes()
    return np.frombuffer(hashlib.sha256(content).digest(), dtype=np.uint8)


def _read(path: Path, filling: Filling) -> Packing | None:
    """The packing kept at `path`, or None if there is none that can be trusted."""
    if not path.exists():
        return None
    try:
        arrays = read_arrays(path)
        scales = frozen(arrays["scales"]) if "scales" in arrays else None
        packing = Packing(frozen(arrays["positions"]), frozen(arrays["orientations"]), scales)
        whole = np.array_equal(arrays["checksum"], _checksum(packing))
        why = filling.flaw(packing) if whole else "its checksum does not fit its content"
    except (ConfigError, OSError, KeyError, ValueError) as error:
        why = str(error)
    if why is None:
        return packing
    log.warning("the packing %s is made again: %s", path, why)
    return None


@contextlib.contextmanager
def _only_one(path: Path) -> Iterator[None]:
    """Hold a lock that dies with its process; others wait. Where there are no locks, all go on."""
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            lock = stack.enter_context(open(path, "w"))
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield
