"""Files of measurements that grow by a line of JSON each, so that what is measured is kept.

Beside `NAME.jsonl` there may be `NAME.jsonl.xz` with older lines. Reading gives the packed lines
first. To pack new lines: `xz -9e -c NAME.jsonl >> NAME.jsonl.xz && rm NAME.jsonl`.
"""

import json
import lzma
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

PLAIN, PACKED = ".jsonl", ".jsonl.xz"


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


def read(path: Path) -> Iterator[tuple[str, Any]]:
    """Place (file and line) and content of each line of `NAME.jsonl` and its packed part.

    Torn lines are left out, and so is a missing file.
    """
    packed = path.with_suffix(PACKED)
    if packed.exists():
        yield from _contents(packed, lzma.decompress(packed.read_bytes()))
    if path.exists():
        yield from _contents(path, path.read_bytes())


def _contents(path: Path, text: bytes) -> Iterator[tuple[str, Any]]:
    for number, line in enumerate(text.splitlines(), start=1):
        try:
            content = json.loads(line)
        except ValueError:  # no JSON, or no UTF-8
            continue
        yield f"{path}:{number}", content


def files_in(directory: Path) -> list[Path]:
    """Each `NAME.jsonl` of a directory, by name; also where only packed lines exist."""
    packed = {path.with_suffix("") for path in directory.glob(f"*{PACKED}")}
    return sorted(packed | set(directory.glob(f"*{PLAIN}")))
