"""Files of measurements that grow by a line of JSON each, so that what is measured is kept."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any


def append(path: Path, content: Mapping[str, Any]) -> None:
    """Add one line; a line that a killed run left torn is ended first."""
    path.parent.mkdir(parents=True, exist_ok=True)
    line = json.dumps(content, separators=(",", ":")) + "\n"
    with path.open("a+b") as file:
        if file.tell() > 0:
            file.seek(-1, 2)
            if file.read(1) != b"\n":
                file.write(b"\n")
        file.write(line.encode())


def read(path: Path) -> Iterator[tuple[int, Any]]:
    """Number, from 1, and content of each line; torn ones are left out, as is a missing file."""
    if not path.exists():
        return
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        try:
            content = json.loads(line)
        except json.JSONDecodeError:
            continue
        yield number, content
