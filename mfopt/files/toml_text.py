"""Reading a TOML file that a user wrote: its text, then its tables; each flaw is named."""

import stat
import tomllib
from pathlib import Path
from typing import Any

from mfopt.errors import ConfigError

MOST_BYTES = 1_000_000


def toml_text(path: Path, kind: str, where_from: str) -> str:
    """The text; what is no file, or far too large for one, is not opened.

    Args:
        path: of the file.
        kind: what it should be, for messages, such as "study file".
        where_from: how to get one, for messages.

    Raises:
        ConfigError: if it cannot be read.
    """
    try:
        about = path.stat()
        if not stat.S_ISREG(about.st_mode):
            what = "a directory" if stat.S_ISDIR(about.st_mode) else "not a file"
            raise ConfigError(f"cannot read {kind} {path}: it is {what}; give a TOML file")
        if about.st_size > MOST_BYTES:
            raise ConfigError(
                f"{kind} {path} has {about.st_size / 1e6:.0f} MB, above the limit of "
                f"{MOST_BYTES / 1e6:.0f} MB; is it the right file?"
            )
        return path.read_text(encoding="utf-8-sig")  # with or without a byte-order mark
    except FileNotFoundError as error:
        raise ConfigError(f"{kind} {path} does not exist; {where_from}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(f"cannot read {kind} {path}: it is not UTF-8 ({error})") from error
    except OSError as error:
        raise ConfigError(f"cannot read {kind} {path}: {error.strerror}") from error


def toml_tables(text: str, where: str) -> dict[str, Any]:
    """The tables of the text.

    Raises:
        ConfigError: if it is not TOML.
    """
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise ConfigError(f"{where}: its tables are nested too deeply; flatten them") from error
    except ValueError as error:  # TOMLDecodeError, and what Python says of numbers too long
        raise ConfigError(f"{where} is not valid TOML: {error}") from error
