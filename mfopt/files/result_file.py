"""Results of a calibration or diagnosis as JSON files, checked when they are read."""

from pathlib import Path
from typing import TypeVar

from pydantic import TypeAdapter, ValidationError

from mfopt.errors import ConfigError

T = TypeVar("T")


def read_result(path: Path, kind: type[T], *, missing: str, again: str) -> T:
    """The result that a file holds.

    Args:
        path: of the file.
        kind: dataclass of the result.
        missing: what it means that there is no file.
        again: how it is written again.

    Raises:
        ConfigError: if there is none, or it is damaged.
    """
    try:
        return TypeAdapter(kind).validate_json(path.read_bytes())
    except FileNotFoundError as error:
        raise ConfigError(f"there is no {path}: {missing}") from error
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(map(str, first["loc"]))
        raise ConfigError(
            f"{path} is damaged{place and f' at {place}'}: {first['msg']}; {again}"
        ) from error
