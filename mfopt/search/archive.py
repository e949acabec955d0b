"""Every run that a search was told of, one row a run."""

from dataclasses import dataclass, field

import numpy as np

from mfopt.arrays import AnyArray, Array, IntArray

FIRST_ROOM = 64  # rows


@dataclass(slots=True)
class _Rows:
    """Room for runs that several archives share, each looking at the first so many rows."""

    columns: tuple[AnyArray, ...]  # (room, ...) as the fields of an archive
    used: int = 0

    @classmethod
    def empty(cls, room: int, d: int, c: int) -> "_Rows":
        return cls(
            (np.empty((room, d)), np.empty(room, dtype=np.int64), np.empty(room, dtype=np.int64),
             np.empty(room), np.empty((room, c)))
        )  # fmt: skip

    def append(self, *row: object) -> None:
        for column, value in zip(self.columns, row, strict=True):
            column[self.used] = value
        self.used += 1

    def archive(self) -> "Archive":
        views = [column[: self.used] for column in self.columns]
        for view in views:
            view.flags.writeable = False
        z, level, seed, value, counts = views
        return Archive(z, level, seed, value, counts, self)


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
    _rows: _Rows = field(repr=False)

    @classmethod
    def empty(cls, d: int) -> "Archive":
        """An archive of no run of `d` variables."""
        return _Rows.empty(0, d, 0).archive()

    def __len__(self) -> int:
        return len(self.value)

    def added(self, z: Array, level: int, seed: int, value: float, counts: Array) -> "Archive":
        """This archive with one run more; `counts` (c,) has as many terms in every run.

        The rows are shared with the archive that is returned. They are copied only where there is
        no room, or where a run was added to this archive before: a constant cost a run.
        """
        rows, n = self._rows, len(self)
        if rows.used != n or n == len(rows.columns[0]):
            rows = _Rows.empty(max(FIRST_ROOM, 2 * n), len(z), len(counts))
            for column, known in zip(
                rows.columns, (self.z, self.level, self.seed, self.value, self.counts), strict=True
            ):
                if n:
                    column[:n] = known
            rows.used = n
        rows.append(z, level, seed, value, counts)
        return rows.archive()

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

    def scatter(self, level: int) -> bool | None:
        """Whether a design has other values on other seeds; None if none finished on two seeds."""
        here = self.finished_at(level)
        here = here[np.lexsort((self.seed[here], *self.z[here].T))]  # equal designs side by side
        z, seed, value = self.z[here], self.seed[here], self.value[here]
        again = (z[1:] == z[:-1]).all(axis=1)
        if (again & (value[1:] != value[:-1])).any():
            return True
        return False if (again & (seed[1:] != seed[:-1])).any() else None
