"""Beginning a run in a directory, or going on with the one that it holds."""

import shutil
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from mfopt.errors import ConfigError
from mfopt.evaluation import Reference
from mfopt.store import RunDirectory, create, open_run

LEAST_DISK = 100e6  # [bytes] a run of 1000 evaluations of 1000 grains takes about half
FIXED = ("mfopt_version", "versions", "levels")  # must not change over a resume


def begin(path: Path, study: str, header: Mapping[str, Any], *, resume: bool) -> RunDirectory:
    """Create the run directory, or make sure that it holds this very study.

    To be called within `mfopt.store.writing`, so that of two starts only one goes on.

    Args:
        path: the run directory.
        study: text of the study file.
        header: what `mfopt.header.header` says of the run now.
        resume: go on with a run that is there.

    Raises:
        ConfigError: if there is a run and `resume` is off, if it is of another study or was
            begun with other programs, or if it cannot be written.
    """
    if not (resume and (path / "run.json").exists()):
        return create(path, study, header)
    run = open_run(path)
    if run.study_file.read_text(encoding="utf-8") != study:
        raise ConfigError(
            f"{path} holds another study than the one given, its own is {run.study_file}; "
            "resume with that one, or give another --directory"
        )
    for key in FIXED:
        if run.header.get(key) != header[key]:
            raise ConfigError(
                f"{path} was begun with another {key}: {_change(run.header.get(key), header[key])}"
                "; resume with what it was begun with, or give another --directory"
            )
    return run


def begin_reference(run: RunDirectory, now: Reference | None) -> None:
    """Note on which engine the reference runs are made, or why they are left out.

    An engine that was missing when the run began may be there when it goes on.

    Raises:
        ConfigError: if a reference run has been made already, with another version.
    """
    if now is None or now == run.reference:
        return
    made = any(purpose.startswith("reference") for purpose in run.purposes)
    if made and now.why_not is None:
        raise ConfigError(
            f"{run.path} has a reference run by another version: "
            f"{_change(asdict(run.reference) if run.reference else None, asdict(now))}; "
            "resume with what it was begun with, or give another --directory"
        )
    if not made:
        run.add_reference(now)


def _change(old: Any, new: Any) -> str:
    if isinstance(old, dict) and isinstance(new, dict):
        keys = sorted(key for key in {*old, *new} if old.get(key) != new.get(key))
        return ", ".join(f"{key} {old.get(key)} (now {new.get(key)})" for key in keys)
    if isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        return ", ".join(f"{a} (now {b})" for a, b in zip(old, new, strict=True) if a != b)
    return f"{old} (now {new})"


def check_disk(path: Path) -> None:
    """Make sure that a new run has room.

    Raises:
        ConfigError: if the disk is nearly full.
    """
    if (path / "run.json").exists():
        return
    parent = next(p for p in (path, *path.absolute().parents) if p.exists())
    free = shutil.disk_usage(parent).free
    if free < LEAST_DISK:
        raise ConfigError(
            f"{free / 1e6:.0f} MB of disk are free for {path}, below the {LEAST_DISK / 1e6:.0f} MB "
            "that a run needs; free some, or give another --directory"
        )
