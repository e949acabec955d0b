"""A run of YADE listens nowhere: neither on the network nor on this machine."""

import os
import shutil
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest
from yade_scenes import BOXED, LIMIT_S, lattice

from fidelity.engine import Movement
from fidelity.engines.yade.engine import PROGRAMS, Precision, YadeEngine

LOOK_S = 0.01  # [s] between two looks
LISTENS = "0A"  # state of a TCP socket that takes connections, in /proc/net/tcp


def processes_below(pid: int) -> list[int]:
    """All descendants of a process."""
    found: list[int] = []
    for listing in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in map(int, read(listing).split()):
            found += [child, *processes_below(child)]
    return found


def read(path: Path) -> str:
    """What is in a file of /proc; nothing once its process has ended."""
    try:
        return path.read_text()
    except OSError:
        return ""


def sockets_of(pid: int) -> set[str]:
    """Inodes of the sockets that a process holds."""
    inodes = set()
    for fd in Path(f"/proc/{pid}/fd").glob("*"):
        try:
            kind, _, inode = os.readlink(fd).partition(":")
        except OSError:
            continue
        if kind == "socket":
            inodes.add(inode.strip("[]"))
    return inodes


def open_ports() -> dict[str, str]:
    """Local address of every socket of this machine that can be reached, by its inode."""
    ports = {}
    for table in ("tcp", "tcp6", "udp", "udp6"):
        for line in read(Path("/proc/net") / table).splitlines()[1:]:
            words = line.split()
            if table.startswith("udp") or words[3] == LISTENS:
                ports[words[9]] = f"{table} {words[1]}"
    return ports


@pytest.mark.yade
@pytest.mark.parametrize("precision", PROGRAMS)
def test_nothing_listens_while_yade_runs(precision: Precision) -> None:
    if shutil.which(PROGRAMS[precision]) is None:
        pytest.skip(f"{PROGRAMS[precision]} is not installed")
    engine, scene = YadeEngine(precision), replace(BOXED, packing=lattice(6), duration=0.05)
    movements: list[Movement] = []
    run = threading.Thread(
        target=lambda: movements.append(engine.move(scene, time_limit_s=LIMIT_S))
    )
    run.start()
    seen, looks = set(), 0
    while run.is_alive():
        time.sleep(LOOK_S)
        ports = open_ports()
        below = processes_below(os.getpid())
        seen |= {ports[inode] for pid in below for inode in sockets_of(pid) if inode in ports}
        looks += any(PROGRAMS[precision] in read(Path(f"/proc/{p}/cmdline")) for p in below)
    assert movements[0].status == "finished", movements[0].why
    assert looks > 20
    assert seen == set()
