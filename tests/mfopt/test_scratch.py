"""Folders for temporary files: what a killed process left is removed, and nothing else."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from fidelity.programs.function import FunctionLevel
from mfopt.campaign.executor import evaluate
from mfopt.errors import ConfigError
from mfopt.files.scratch import PREFIX, remove_leftovers, scratch


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    remove_leftovers.cache_clear()
    yield tmp_path
    remove_leftovers.cache_clear()


HOLDER = """
from mfopt.files.scratch import scratch
with scratch() as folder:
    (folder / "file").touch()
    print(folder, flush=True)
    input()
"""


def start_holder(temporary: Path) -> tuple[subprocess.Popen[str], Path]:
    """Another process that uses a folder until it is told to end, or killed."""
    path = os.pathsep.join(filter(None, sys.path))
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLDER], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        env={**os.environ, "TMPDIR": str(temporary), "PYTHONPATH": path},
    )  # fmt: skip
    assert holder.stdout is not None
    return holder, Path(holder.stdout.readline().strip())


def test_a_folder_is_removed_at_its_end(temporary: Path) -> None:
    with scratch() as folder:
        assert folder.parent == temporary
        (folder / "below").mkdir()
        (folder / "below" / "file").touch()
    assert list(temporary.iterdir()) == []


def test_folders_of_killed_processes_are_removed_and_those_in_use_are_kept(
    temporary: Path,
) -> None:
    living, used = start_holder(temporary)
    dead, left = start_holder(temporary)
    dead.kill()
    dead.communicate()
    assert left.exists()
    with scratch() as folder:
        assert sorted(temporary.iterdir()) == sorted([folder, used])
        assert (used / "file").exists()
    living.communicate("")
    assert list(temporary.iterdir()) == []


def test_nothing_else_is_removed(temporary: Path) -> None:
    (temporary / "mfopt-results").mkdir()
    (temporary / "mine").mkdir()
    (temporary / f"{PREFIX}link").symlink_to("mine")
    (temporary / f"{PREFIX}file").touch()
    before = sorted(temporary.iterdir())
    with scratch():
        pass
    assert sorted(temporary.iterdir()) == before


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can give files to another user")
def test_folders_of_other_users_are_kept(temporary: Path) -> None:
    (temporary / f"{PREFIX}other").mkdir()
    os.chown(temporary / f"{PREFIX}other", 61234, 61234)
    with scratch():
        pass
    assert (temporary / f"{PREFIX}other").exists()


def test_a_folder_that_is_made_while_another_process_cleans_is_kept(temporary: Path) -> None:
    def clean(_: int) -> None:
        remove_leftovers.__wrapped__(temporary)

    with ThreadPoolExecutor(2) as others:
        cleaning = [others.submit(clean, n) for n in range(500)]
        while not all(c.done() for c in cleaning):
            with scratch() as folder:
                (folder / "file").touch()
                assert (folder / "file").exists()
    assert list(temporary.iterdir()) == []


def test_where_no_folder_can_be_made_one_line_says_so(
    temporary: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", "/proc")
    with pytest.raises(ConfigError, match="cannot write /proc"), scratch():
        pass


def test_where_there_is_no_temporary_directory_the_variable_is_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def none() -> str:
        raise FileNotFoundError("No usable temporary directory found")

    monkeypatch.setattr(tempfile, "gettempdir", none)
    with pytest.raises(ConfigError, match="set TMPDIR"):
        evaluate(FunctionLevel("f", max), np.zeros(1), 1)
