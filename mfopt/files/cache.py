"""Where compiled code and settled packings are kept: the user's cache, or a temporary one."""

import contextlib
import functools
import logging
import multiprocessing
import os
import secrets
import stat
from pathlib import Path

from mfopt.errors import ConfigError
from mfopt.files.scratch import temporary_directory

PROBE = bytes(2**20)  # what a cache that is not full can take

log = logging.getLogger(__name__)


def cache_directory() -> Path:
    """`$XDG_CACHE_HOME/mfopt` or `~/.cache/mfopt`; where these take no files, one in TMPDIR.

    The temporary one is the same for all processes of a user, and is used again.

    Raises:
        ConfigError: if none takes files; the message names the variables.
    """
    return _directory(_wanted(), _temporary())


def _wanted() -> Path | None:
    base = os.environ.get("XDG_CACHE_HOME", "")
    if os.path.isabs(base):  # the standard says to ignore others
        return Path(base) / "mfopt"
    try:
        return Path.home() / ".cache" / "mfopt"
    except RuntimeError:  # neither HOME nor an entry for this user
        return None


def _temporary() -> Path | None:
    try:
        return temporary_directory() / f"mfopt-cache-{os.geteuid()}"
    except ConfigError:
        return None


@functools.cache
def _directory(wanted: Path | None, temporary: Path | None) -> Path:
    if wanted is None:
        why = "this user has no home"
    else:
        why = _why_unusable(wanted)
        if not why:
            return wanted
        why = f"{wanted}: {why}"
    if temporary is None or (also := _why_unusable(temporary, private=True)):
        also = "no temporary directory can be written" if temporary is None else also
        raise ConfigError(
            f"nothing can be kept ({why}; {also}); set XDG_CACHE_HOME to a directory that can be "
            "written"
        )
    if multiprocessing.parent_process() is None:  # said once, not by every worker
        log.warning(
            "compiled code and packings are kept in %s, as the usual cache takes no files (%s); "
            "set XDG_CACHE_HOME to a directory that can be written", temporary, why,
        )  # fmt: skip
    return temporary


def _why_unusable(path: Path, *, private: bool = False) -> str:
    """Why no files can be written below `path`, made if need be; empty if they can."""
    probe = path / f".probe.{secrets.token_hex(8)}"
    try:
        path.mkdir(parents=True, exist_ok=True, mode=0o700)
        if private and not _is_mine_alone(path):
            return f"{path} can be written by others"
        with contextlib.ExitStack() as after:
            after.callback(probe.unlink, missing_ok=True)
            probe.write_bytes(PROBE)
    except OSError as error:
        return error.strerror or str(error)
    return ""


def _is_mine_alone(path: Path) -> bool:
    its = path.lstat()  # a link that another user made is not followed
    return stat.S_ISDIR(its.st_mode) and its.st_uid == os.geteuid() and not its.st_mode & 0o022
