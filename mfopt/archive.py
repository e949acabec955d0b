"""Every run that a search was told of, one row a run."""

from dataclasses import dataclass

import numpy as np

from mfopt.arrays import Array, IntArray, frozen


@dataclass(frozen=True, slots=True, eq=False)
class Archive:
    """Runs in the order they were told.

    Args:
        z: (n, d) designs in the unit cube.
        level: (n,) index of the level in the ladder, 0 the coarsest.
        seed: (n,) simulation seed.
        value: (n,) objective; infinite for a failed run.
        counts: (n, c) soft-constraint terms contained in `value`.
    """

    z: Array
    level: IntArray
    seed: IntArray
    value: Array
    counts: Array

    @classmethod
    def empty(cls, d: int) -> "Archive":
        """An archive of no run of `d` variables."""
        none = np.empty(0, dtype=np.int64)
        return cls(np.empty((0, d)), none, none, np.empty(0), np.empty((0, 0)))

    def __len__(self) -> int:
        return len(self.value)

    def added(self, z: Array, level: int, seed: int, value: float, counts: Array) -> "Archive":
        """This archive with one run more; `counts` (c,) has as many terms in every run."""
        before = self.counts if len(self) else np.empty((0, len(counts)))
        return Archive(
            frozen(np.vstack([self.z, z])),
            np.append(self.level, level),
            np.append(self.seed, seed),
            frozen(np.append(self.value, value)),
            frozen(np.vstack([before, counts])),
        )

    @property
    def finished(self) -> int:
        """Number of runs that did not fail."""
        return int(np.isfinite(self.value).sum())

    def designs_at(self, level: int) -> Array:
        """Designs (n, d) of the runs at a level, in order."""
        return np.asarray(self.z[self.level == level])

    def values_at(self, level: int) -> Array:
        """Objective of the runs at a level, in order."""
        return np.asarray(self.value[self.level == level])

    def finished_at(self, level: int) -> IntArray:
        """Rows of the runs at a level that did not fail, in order."""
        return np.flatnonzero((self.level == level) & np.isfinite(self.value))

    def best_at(self, level: int) -> tuple[Array, float]:
        """Design (d,) of the best run at a level, and its value; a run must have finished there."""
        here = self.finished_at(level)
        best = here[int(np.argmin(self.value[here]))]
        return np.asarray(self.z[best]), float(self.value[best])

    def beats_others(self, z: Array, level: int) -> bool:
        """Whether the design `z` (d,) was run at a level, and others, and is better than them."""
        values = self.values_at(level)
        its = (self.designs_at(level) == z).all(axis=1)
        return bool(its.any() and not its.all() and values[its].min() < values[~its].min())

    def exact(self, level: int) -> bool:
        """Whether runs at a level do not scatter: a design has one value on all seeds.

        False where no design has finished on two seeds.
        """
        here = self.finished_at(level)
        here = here[np.lexsort((self.seed[here], *self.z[here].T))]  # equal designs side by side
        z, seed, value = self.z[here], self.seed[here], self.value[here]
        again = (z[1:] == z[:-1]).all(axis=1)
        scatter = again & (value[1:] != value[:-1])
        return bool((again & (seed[1:] != seed[:-1])).any() and not scatter.any())
