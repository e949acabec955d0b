"""The file run.json of a run directory: written once, with its format and a check."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mfopt.errors import ConfigError
from mfopt.files.array_file import digest
from mfopt.files.whole import disk_errors_named

FORMAT = 2
READ_BY = {"1": "mfopt 0.1"}  # which version reads an older format


def sealed(header: Mapping[str, Any]) -> dict[str, Any]:
    """The header with its format and its check."""
    its = {"format": FORMAT, **header}
    return {**its, "check": _check(its)}


def read_header(path: Path) -> dict[str, Any]:
    """Read the header of a run from `path`.

    Raises:
        ConfigError: if there is none, it is of another format, or it is damaged.
    """
    if not os.path.lexists(path):
        raise ConfigError(f"{path.parent} is not a run directory: it has no run.json")
    with disk_errors_named(path, "read"):
        content = path.read_bytes()
    try:
        header = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{path} is damaged: it is no JSON; restore it") from error
    if not isinstance(header, dict):
        raise ConfigError(f"{path} is damaged: it is no JSON object; restore it")
    if (found := header.get("format")) != FORMAT:
        reader = READ_BY.get(str(found), "the version of mfopt that wrote it")
        raise ConfigError(
            f"{path.parent} was written in format {found!r}, this version reads {FORMAT}; use "
            f"{reader}, or start a new run directory"
        )
    if header.get("check") != _check(header):
        raise ConfigError(f"{path} is damaged: its check does not fit; restore it")
    return header


def _check(header: Mapping[str, Any]) -> str:
    """Digest of a header, but for the check in it."""
    its = {name: value for name, value in header.items() if name != "check"}
    return digest(json.dumps(its, sort_keys=True).encode())
