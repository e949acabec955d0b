"""Where compiled code is kept, and for how long."""

import os
import time
from pathlib import Path

from fidelity.dem.compiled import KEPT_S, keep_in_use


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
