"""The cache: where the desktop standard says, and a temporary one where that takes no files."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

from mfopt.errors import ConfigError
from mfopt.files.cache import cache_directory


@pytest.fixture(autouse=True)
def _temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "tmp"))


def test_the_cache_lies_where_the_desktop_standard_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert cache_directory() == tmp_path / "xdg" / "mfopt"
    for unset in ("", "relative/path"):
        monkeypatch.setenv("XDG_CACHE_HOME", unset)
        assert cache_directory() == tmp_path / "home" / ".cache" / "mfopt"
    assert list(cache_directory().iterdir()) == []


@pytest.mark.parametrize(("variable", "value"), [("XDG_CACHE_HOME", "/proc/x"), ("HOME", "/proc")])
def test_without_a_cache_that_takes_files_there_is_a_temporary_one_and_a_warning(
    variable: str,
    value: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv(variable, value)
    found = cache_directory()
    assert found.parent == tmp_path / "tmp"
    assert found.stat().st_mode & 0o777 == 0o700
    assert cache_directory() == found
    assert [r.message.count("XDG_CACHE_HOME") for r in caplog.records] == [1]


def test_a_temporary_cache_that_others_can_write_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Whoever writes there could have this user run code.
    monkeypatch.setenv("XDG_CACHE_HOME", "/proc/x")
    (tmp_path / "tmp" / f"mfopt-cache-{os.geteuid()}").mkdir()
    (tmp_path / "tmp" / f"mfopt-cache-{os.geteuid()}").chmod(0o777)
    with pytest.raises(ConfigError, match=r"by others.*set XDG_CACHE_HOME"):
        cache_directory()


WITHOUT_PASSWD_ENTRY = """
import os
from mfopt.files.cache import cache_directory
os.environ.pop("HOME", None)
os.environ.pop("XDG_CACHE_HOME", None)
os.setuid(61234)
print(cache_directory())
"""

FULL = """
import resource
from mfopt.files.cache import cache_directory
from mfopt.errors import ConfigError
resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))
try:
    cache_directory()
except ConfigError as error:
    print(error)
"""


def run(script: str, tmp_path: Path) -> str:
    (tmp_path / "tmp").chmod(0o777)
    return subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, "TMPDIR": "/tmp", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        text=True,
        check=True,
        capture_output=True,
    ).stdout.strip()


@pytest.mark.skipif(os.geteuid() != 0, reason="only root can become another user")
def test_a_user_without_a_passwd_entry_has_a_temporary_cache(tmp_path: Path) -> None:
    found = Path(run(WITHOUT_PASSWD_ENTRY, tmp_path))
    assert found.name == "mfopt-cache-61234"
    assert found.is_dir()
    found.rmdir()


def test_where_nothing_can_be_written_one_line_names_the_variable(tmp_path: Path) -> None:
    said = run(FULL, tmp_path)
    assert len(said.splitlines()) == 1
    assert "too large" in said  # as a full disk or an exceeded quota
    assert "set XDG_CACHE_HOME" in said
