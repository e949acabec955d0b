"""A case that is to be written: the text of its files."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path


@dataclass(frozen=True, slots=True, eq=False)
class CaseText:
    """A case file, and the recordings that are written beside it."""

    name: str
    text: str
    runs: int
    files: Mapping[str, str] = field(default_factory=dict)  # by name


def head(name: str, rig: str, parameters: Iterable[str], measurement: str) -> str:
    """The case file before its recordings, from the text of its tables."""
    return f"""[case]
name = "{name}"
seed = 1

[rig]
{rig}
{"".join(parameters)}
[measurement]
{measurement}"""


def function_rig(file: Path, function: str, channel: str, unit: str, size: float) -> str:
    """The table `rig` of a Python function that gives one channel."""
    return f"""function = "{file}:{function}"

[rig.channels.{channel}]
unit = "{unit}"
size = {size}
"""
