"""Where compiled code is kept, for how long, and what becomes of damaged code."""

import os
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from fidelity.dem.compiled import KEPT_S, compiled, keep, keep_in_use, read_kept


def made(directory: Path, unused_s: float) -> Path:
    (directory / "kernel").mkdir(parents=True)
    then = time.time() - unused_s
    os.utime(directory, (then, then))
    return directory


def test_code_long_out_of_use_is_removed_and_other_is_kept(tmp_path: Path) -> None:
    old = made(tmp_path / "old", KEPT_S + 60.0)
    recent = made(tmp_path / "recent", KEPT_S - 60.0)
    keep_in_use(tmp_path / "new")
    assert not old.exists()
    assert (recent / "kernel").exists()
    assert (tmp_path / "new").exists()


def test_code_taken_into_use_again_is_kept(tmp_path: Path) -> None:
    old = made(tmp_path / "old", KEPT_S + 60.0)
    keep_in_use(old)
    keep_in_use(tmp_path / "new")
    assert (old / "kernel").exists()


def plus_one(x: float) -> float:
    return x + 1.0


def cut(content: bytes) -> bytes:
    return content[: len(content) // 2]


def changed(content: bytes) -> bytes:
    return content[:-100] + bytes(100)


@pytest.mark.parametrize("damage", [cut, changed, lambda content: b""])
def test_damaged_code_is_compiled_again(
    damage: Callable[[bytes], bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    first, second, third = compiled(plus_one), compiled(plus_one), compiled(plus_one)
    assert first(1.0) == 2.0
    (kept,) = tmp_path.glob("mfopt/compiled/*/plus_one-*.code")
    content = kept.read_bytes()
    kept.write_bytes(damage(content))
    assert second(1.0) == 2.0
    assert sum(second.stats.cache_hits.values()) == 0
    assert third(1.0) == 2.0
    assert sum(third.stats.cache_hits.values()) == 1


def test_what_is_not_whole_is_deleted_and_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "folder" / "code"
    keep(path, b"machine code")
    assert read_kept(path) == b"machine code"
    path.write_bytes(path.read_bytes()[:-1])
    assert read_kept(path) is None
    assert not path.exists()
    assert read_kept(path) is None
    assert [r.message for r in caplog.records] == [
        f"{path} is damaged, and its function is compiled again"
    ]


def test_code_that_no_disk_takes_is_used_all_the_same(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr("fidelity.dem.compiled.cache_directory", lambda: Path("/proc/x"))
    assert compiled(plus_one)(1.0) == 2.0
    assert "cannot be kept" in caplog.text
