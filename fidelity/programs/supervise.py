"""The keeper of one simulator: runs a command, and leaves none of its processes behind.

Run as `python -I -S supervise.py PARENT TIME_LIMIT STDIN_FD REPORT_FD COMMAND...` by
`fidelity.programs.process`. It ends the command with all its descendants when the time is up, when
its own standard input is closed, or when the process PARENT is gone, however that died. It
watches that process rather than ask to be killed by PR_SET_PDEATHSIG, because that signal comes
when the *thread* that started us ends. The command itself gets the signal, in case somebody
kills the keeper. The keeper asks for SIGCONT, which does nothing unless somebody has stopped it.
The command writes to our standard output and standard error. At the end one line of JSON goes to
REPORT_FD: `{"returncode", "timed_out", "cpu_s"}`.

Its start is part of every run's cost: of the standard library it imports only what loads in
a few milliseconds, hence no json, signal, subprocess or typing (20 ms instead of 50).
"""

import ctypes
import os
import resource
import select
import sys

# linux/prctl.h
PR_SET_PDEATHSIG = 1
PR_SET_CHILD_SUBREAPER = 36

# signal(7)
SIGKILL = 9
SIGPIPE = 13
SIGCONT = 18
SIG_DFL = None

NOT_STARTED = 127  # exit status of a command that cannot be started, as in sh(1)

LIBC = ctypes.CDLL(None)


def main(arguments: list[str]) -> None:
    """Run the command, end what is left of it, and say how it ended."""
    parent, time_limit_s = int(arguments[0]), float(arguments[1])
    stdin, report = int(arguments[2]), int(arguments[3])
    os.set_inheritable(report, False)
    LIBC.prctl(PR_SET_CHILD_SUBREAPER, 1)  # orphans among the descendants become our children
    LIBC.prctl(PR_SET_PDEATHSIG, SIGCONT)
    parent_fd = os.pidfd_open(parent)
    if os.getppid() != parent:
        return
    keeper = os.getpid()
    child = os.fork()
    if child == 0:
        LIBC.prctl(PR_SET_PDEATHSIG, SIGKILL)
        if os.getppid() == keeper:
            _become(arguments[4:], stdin)
        os._exit(NOT_STARTED)
    child_fd = os.pidfd_open(child)
    timed_out = not _any_ready([child_fd, parent_fd, 0], time_limit_s)
    code = _end_all(child)
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_s = usage.ru_utime + usage.ru_stime
    flag = "true" if timed_out else "false"
    if not _any_ready([parent_fd], 0.0):  # somebody is left to tell
        said = f'{{"returncode": {code}, "timed_out": {flag}, "cpu_s": {cpu_s!r}}}'
        os.write(report, said.encode())


def _become(command: list[str], stdin: int) -> None:
    """Replace this process by the command; returns only if that fails."""
    LIBC.signal(SIGPIPE, SIG_DFL)  # Python ignores it, and the command would inherit that
    os.dup2(stdin, 0)
    os.close(stdin)
    try:
        os.execvp(command[0], command)
    except OSError as error:
        os.write(2, f"cannot start {command[0]}: {error}\n".encode())


def _any_ready(fds: list[int], time_limit_s: float) -> bool:
    """Wait until a process has ended or a pipe is closed; False if the time is up first."""
    poll = select.poll()
    for fd in fds:
        poll.register(fd, select.POLLIN)
    return bool(poll.poll(min(1e3 * time_limit_s, 2**31 - 1)))  # [ms], a C int


def _end_all(child: int) -> int | None:
    """Kill and reap every descendant; the exit code of `child`, negative for a signal."""
    code = None
    finished, status = os.waitpid(child, os.WNOHANG)  # so that a kill below cannot alter it
    if finished:
        code = os.waitstatus_to_exitcode(status)
    while True:
        for pid in _children():
            os.kill(pid, SIGKILL)
        try:
            pid, status = os.wait()
        except ChildProcessError:
            return code
        if pid == child:
            code = os.waitstatus_to_exitcode(status)


def _children() -> list[int]:
    """Our children, living or dead; those of dead children have become ours."""
    with open(f"/proc/self/task/{os.getpid()}/children", encoding="ascii") as listing:
        return [int(pid) for pid in listing.read().split()]


if __name__ == "__main__":
    main(sys.argv[1:])
