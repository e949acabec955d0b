"""Of several who want a directory exactly one gets it, whatever the file system can."""

import errno
import fcntl
import os
import signal
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from mfopt.errors import ConfigError
from mfopt.files.lock import held

NO_LOCKS = (errno.EBADF, errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)


@pytest.fixture(params=["flock", "link"])
def file_system(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """A file system that knows `flock`, and one that does not."""
    if request.param == "link":
        without_flock(monkeypatch, errno.ENOLCK)
    return str(request.param)


def without_flock(monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    def refuse(file: int, operation: int) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, "flock", refuse)


def test_second_is_refused_until_the_first_has_ended(tmp_path: Path, file_system: str) -> None:
    for _ in range(3):
        with held(tmp_path / "run"):
            with (
                pytest.raises(ConfigError, match="another mfopt is running"),
                held(tmp_path / "run"),
            ):
                pass
            with (
                pytest.raises(ConfigError, match="another mfopt is running"),
                held(tmp_path / "run"),
            ):
                pass


def goes_on(path: Path, together: threading.Barrier, done: threading.Barrier) -> bool:
    """Whether this thread of several goes on; who does holds `path` until all have tried."""
    together.wait()
    try:
        with held(path):
            done.wait()
            return True
    except ConfigError:
        done.wait()
        return False


def test_of_many_who_start_at_once_exactly_one_goes_on(tmp_path: Path, file_system: str) -> None:
    together, done = threading.Barrier(4), threading.Barrier(4)
    with ThreadPoolExecutor(4) as threads:
        for number in range(100):
            path = tmp_path / str(number % 20)  # new directories, and used ones
            tries = [threads.submit(goes_on, path, together, done) for _ in range(4)]
            assert sum(one.result() for one in tries) == 1


@pytest.mark.parametrize("number", NO_LOCKS, ids=errno.errorcode.get)
def test_without_flock_a_link_names_the_holder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    without_flock(monkeypatch, number)
    with held(tmp_path):
        (link,) = tmp_path.glob("lock.*")
        assert str(os.getpid()) in os.readlink(link).split()
        refusal = rf"process {os.getpid()} of .* delete .*/lock\.1"
        with pytest.raises(ConfigError, match=refusal), held(tmp_path):
            pass


HOLDER = """
import errno, fcntl, sys, time
from pathlib import Path
from mfopt.files.lock import held
def refuse(file, operation):
    raise OSError(errno.ENOLCK, "no locks available")
if sys.argv[2] == "link":
    fcntl.flock = refuse
with held(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


def test_a_killed_holder_holds_no_more(tmp_path: Path, file_system: str) -> None:
    command = [sys.executable, "-c", HOLDER, str(tmp_path), file_system]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as holder:
        assert holder.stdout is not None
        holder.stdout.readline()
        with pytest.raises(ConfigError, match="another mfopt"), held(tmp_path):
            pass
        os.kill(holder.pid, signal.SIGKILL)
        os.waitid(os.P_PID, holder.pid, os.WEXITED | os.WNOWAIT)  # gone, though not reaped yet
        with held(tmp_path), pytest.raises(ConfigError, match="another mfopt"), held(tmp_path):
            pass


def test_two_who_find_the_holder_gone_cannot_both_go_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One reads that the holder is gone, and makes its link only after another came and went."""
    without_flock(monkeypatch, errno.ENOLCK)
    with held(tmp_path):
        pass
    real, others = os.listdir, [held(tmp_path), held(tmp_path)]

    def slow(path: Path) -> list[str]:
        names = real(path)
        monkeypatch.setattr(os, "listdir", real)
        others[0].__enter__()
        others[0].__exit__(None, None, None)
        others[1].__enter__()
        return names

    monkeypatch.setattr(os, "listdir", slow)
    with pytest.raises(ConfigError, match="another mfopt"), held(tmp_path):
        pass
    others[1].__exit__(None, None, None)
    with held(tmp_path):
        pass


def test_a_holder_on_another_machine_is_never_taken_for_gone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    without_flock(monkeypatch, errno.ENOLCK)
    (tmp_path / "lock.3").symlink_to("elsewhere pid:[1] 999999 1")
    with pytest.raises(ConfigError, match=r"of elsewhere.*lock\.3"), held(tmp_path):
        pass


def test_what_cannot_be_written_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    (tmp_path / "dir" / "lock").mkdir(parents=True)
    for path in ("file", "file/below", "dir"):
        refusal = f"cannot write {tmp_path}/{path}: "
        with pytest.raises(ConfigError, match=refusal), held(tmp_path / path):
            pass
