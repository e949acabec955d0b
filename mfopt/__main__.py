"""Entry point of the `mfopt` program."""

import os


def main() -> None:
    """Run the command line, one thread a process.

    Runs are what is done in parallel, and no result may depend on the number of cores.
    """
    for library in ("OMP", "OPENBLAS", "MKL"):
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
    from mfopt.commands.app import app

    app()


if __name__ == "__main__":
    main()
