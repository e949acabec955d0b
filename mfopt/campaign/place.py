"""Where a run may be written: a folder that is new, empty or a run directory; enough disk."""

import os
import shutil
from pathlib import Path

from mfopt.errors import ConfigError
from mfopt.files import lock
from mfopt.files.whole import disk_errors_named

LEAST_DISK = 100e6  # [bytes] a run of 1000 evaluations of 1000 grains takes about half
BEGUN = ("study.toml", "outcomes")  # what a run is that was broken off before its journal
SHOWN = 5  # names of files that a message has


def check_place(path: Path) -> None:
    """Make sure that no file of the user's own would be written over.

    A run directory has a `run.json` or a journal. One whose beginning was broken off has a lock,
    which is made first. Hidden files are not in the way.

    Raises:
        ConfigError: if the folder holds files and is no run directory.
    """
    if not path.is_dir():
        return
    with disk_errors_named(path, "read"):
        names = sorted(os.listdir(path))
    if "run.json" in names or "journal.jsonl" in names:
        return
    own = BEGUN if lock.FILE in names else ()
    others = [n for n in names if n not in own and n.split(".")[0] not in ("", lock.FILE)]
    if others:
        more = f" and {len(others) - SHOWN} more" if len(others) > SHOWN else ""
        raise ConfigError(
            f"{path} holds {', '.join(others[:SHOWN])}{more}, and is no run directory of mfopt: it "
            "has no run.json; give a new or an empty folder, so that nothing of yours is replaced"
        )


def check_disk(path: Path) -> None:
    """Make sure that a new run has room.

    Raises:
        ConfigError: if the disk is nearly full.
    """
    if os.path.lexists(path / "run.json"):
        return
    parent = next(p for p in (path, *path.absolute().parents) if p.exists())
    with disk_errors_named(parent, "read"):
        disk = shutil.disk_usage(parent)
    if disk.total > 0 and disk.free < LEAST_DISK:  # /proc has no size, and cannot be written
        raise ConfigError(
            f"{disk.free / 1e6:.0f} MB of disk are free for {path}, below the "
            f"{LEAST_DISK / 1e6:.0f} MB that a run needs; free some, or give another --directory"
        )
