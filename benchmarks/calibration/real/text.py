"""A case that is to be written: the text of its files."""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True, eq=False)
class CaseText:
    """A case file, and the recordings that are written beside it."""

    name: str
    text: str
    runs: int
    files: Mapping[str, str] = field(default_factory=dict)  # by name
