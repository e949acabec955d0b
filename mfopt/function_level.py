"""A Python function as a level."""

from collections.abc import Callable
from dataclasses import dataclass
from time import process_time

import numpy as np

from mfopt.arrays import Array
from mfopt.outcome import Outcome, Status

Simulator = Callable[[Array, int], float]  # (x (d,), seed) -> objective value


@dataclass(frozen=True, slots=True)
class FunctionLevel:
    """A Python function as a level: `function(x, seed)` returns the number to minimise."""

    name: str
    function: Simulator
    work_per_run: float = 1.0

    def work(self, x: Array) -> float:
        """Work of one run, in the user's own unit."""
        return self.work_per_run

    def evaluate(self, x: Array, *, seed: int) -> Outcome:
        """Call the function once; an exception or a value that is no number is a crash."""
        began = process_time()
        status: Status = "finished"
        why, raw = None, {}
        try:
            f = float(self.function(x, seed))
            raw = {"f": np.asarray(f)}
            if not np.isfinite(f):
                status, why = "crashed", f"the function returned {f}"
        except Exception as error:
            status, why = "crashed", f"{type(error).__name__}: {error}"
        cpu_s = process_time() - began
        return Outcome(x, self.name, seed, status, why, raw, self.work_per_run, cpu_s)
