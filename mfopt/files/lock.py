"""One writer at a time in a directory, on network file systems too.

The lock is `flock` on a file of its own, which stays. Where the file system knows no `flock`, the
lock is a symbolic link `lock.N` that names its holder, because a link appears whole or not at
all, and exactly one of two who make the same link succeeds. Who finds the holder of the highest
number gone makes the next number; a number is removed only when a higher one is there, so that
two who find the same holder gone cannot both go on.
"""

import contextlib
import fcntl
import os
import socket
from collections.abc import Iterator
from pathlib import Path

from mfopt.errors import ConfigError
from mfopt.files.whole import disk_errors_named

FILE = "lock"
FREE = "free"  # what a link says when its holder has ended


@contextlib.contextmanager
def held(path: Path) -> Iterator[None]:
    """Hold the directory `path`, which is made if need be, against every other process and thread.

    Raises:
        ConfigError: if another holds it, or if it cannot be written.
    """
    with disk_errors_named(path, "write"):
        path.mkdir(parents=True, exist_ok=True)
        number = os.open(path / FILE, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    try:
        with contextlib.nullcontext() if _flock(path, number) else _held_by_link(path):
            yield
    finally:
        os.close(number)


def _flock(path: Path, number: int) -> bool:
    """Lock an open file; False where the file system has no such locks."""
    try:
        fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        raise ConfigError(f"another mfopt is running in {path}; wait for it to end") from error
    except OSError:
        return False
    return True


@contextlib.contextmanager
def _held_by_link(path: Path) -> Iterator[None]:
    with disk_errors_named(path, "lock"):
        mine = _claim(path)
    try:
        yield
    finally:
        with contextlib.suppress(OSError):  # else the next start finds this process gone
            aside = path / f".{FILE}.{os.getpid()}"
            aside.symlink_to(FREE)
            aside.replace(mine)


def _claim(path: Path) -> Path:
    """Make the link of the next number, if the holder of the highest one is gone."""
    before = _links(path)
    last = max(before, default=0)
    if last:
        _check_gone(path, before[last])
    mine = path / f"{FILE}.{last + 1}"
    try:
        mine.symlink_to(_myself())
    except FileExistsError as error:
        raise _busy(path, mine) from error
    if max(_links(path)) > last + 1:  # all since `before` was read
        mine.unlink(missing_ok=True)
        raise _busy(path, mine)
    for link in before.values():
        link.unlink(missing_ok=True)
    return mine


def _links(path: Path) -> dict[int, Path]:
    names = (entry for entry in os.listdir(path) if entry.startswith(f"{FILE}."))
    numbers = (name.removeprefix(f"{FILE}.") for name in names)
    return {int(number): path / f"{FILE}.{number}" for number in numbers if number.isdecimal()}


def _check_gone(path: Path, link: Path) -> None:
    """Refuse if the holder that a link names is there, or may be."""
    try:
        holder = os.readlink(link)
    except FileNotFoundError as error:  # another has made the next one meanwhile
        raise _busy(path, link) from error
    if holder == FREE:
        return
    where, pid, began = holder.rsplit(" ", 2)
    if where != _machine() or _beginning(int(pid)) == began:
        raise _busy(path, link, f" as process {pid} of {where.split()[0]}")


def _busy(path: Path, link: Path, who: str = "") -> ConfigError:
    return ConfigError(
        f"another mfopt is running in {path}{who}; wait for it to end, or, if it is gone, "
        f"delete {link}"
    )


def _myself() -> str:
    return f"{_machine()} {os.getpid()} {_beginning(os.getpid())}"


def _machine() -> str:
    """The host, and the container on it, in which a process number means something."""
    return f"{socket.gethostname()} {os.readlink('/proc/self/ns/pid')}"


def _beginning(pid: int) -> str | None:
    """When a process began [clock ticks since boot]; None if it has ended."""
    try:
        text = Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return None
    state, *values = text[text.rindex(")") + 1 :].split()  # the name before may hold anything
    return None if state == "Z" else values[18]
