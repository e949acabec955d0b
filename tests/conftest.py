"""One thread a process, as the program `mfopt` sets it: tests run in parallel instead."""

import os

for library in ("OMP", "OPENBLAS", "MKL"):  # before numpy or torch is loaded
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")
