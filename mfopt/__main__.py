"""Entry point of the `mfopt` program."""

import os
import signal
import sys
from io import TextIOWrapper

from mfopt import LINUX_ONLY


def main() -> None:
    """Run the command line, one thread a process.

    Runs are what is done in parallel, and no result may depend on the number of cores.
    """
    if sys.platform != "linux":
        print(f"error: {LINUX_ONLY}", file=sys.stderr)
        sys.exit(2)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # where a terminal lacks a character
    for library in ("OMP", "OPENBLAS", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # ends as Ctrl-C does
    from mfopt.commands.app import app

    app()


if __name__ == "__main__":
    main()
