"""Lines of measurements, plain and packed."""

import lzma
from pathlib import Path

from benchmarks import lines


def test_packed_lines_come_first_and_new_ones_are_added_beside(tmp_path: Path) -> None:
    path = tmp_path / "runs.jsonl"
    packed = tmp_path / "runs.jsonl.xz"
    packed.write_bytes(lzma.compress(b'{"n":1}\n') + lzma.compress(b'{"n":2}\n'))
    lines.append(path, {"n": 3})
    assert list(lines.read(path)) == [
        (f"{packed}:1", {"n": 1}),
        (f"{packed}:2", {"n": 2}),
        (f"{path}:1", {"n": 3}),
    ]


def test_a_file_of_which_only_packed_lines_exist_is_found(tmp_path: Path) -> None:
    (tmp_path / "b.jsonl.xz").write_bytes(lzma.compress(b"{}\n"))
    lines.append(tmp_path / "a.jsonl", {})
    lines.append(tmp_path / "b.jsonl", {})
    assert lines.files_in(tmp_path) == [tmp_path / "a.jsonl", tmp_path / "b.jsonl"]
    assert list(lines.read(tmp_path / "missing.jsonl")) == []
