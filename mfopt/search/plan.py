"""The runs of a search, planned and out, and what its budget still allows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mfopt.arrays import Array


@dataclass(frozen=True, slots=True, eq=False)
class PlannedRun:
    """A run that is planned or out."""

    z: Array  # (d,) design, unit cube
    level: int
    awaited: bool  # whether the search goes on only when it is told
    seed: int | None  # simulation seed; None: that of the generation


class Plan:
    """Runs in the order in which they are to begin; what is planned counts as spent.

    Args:
        costs: of one run, by level.
        budget: cost that may be spent.
    """

    def __init__(self, costs: Sequence[float], budget: float) -> None:
        self.costs, self.budget = tuple(costs), budget
        self._planned: list[PlannedRun] = []
        self._out: dict[int, PlannedRun] = {}
        self._awaited: set[int] = set()
        self._begun = 0
        self.spent = np.zeros(len(costs))  # on runs that have begun, by level

    @property
    def target(self) -> int:
        """The last level."""
        return len(self.costs) - 1

    def __bool__(self) -> bool:
        """Whether a run can begin."""
        return bool(self._planned)

    @property
    def waits(self) -> bool:
        """Whether the search must wait, for a run to begin or for one to end."""
        return bool(self._planned or self._awaited)

    def left_after(self, level: int, runs: int = 1) -> float:
        """Budget neither spent nor planned for, less some more runs at a level."""
        planned = sum(self.costs[run.level] for run in self._planned)
        return float(self.budget - self.spent.sum() - planned - runs * self.costs[level])

    def add(self, z: Array, level: int, *, awaited: bool = True, seed: int | None = None) -> None:
        """Plan a run after those planned before."""
        self._planned.append(PlannedRun(z, level, awaited, seed))

    def drop(self, z: Array, level: int) -> None:
        """Take back what is planned, and has not begun, of a design (d,) at a level."""
        self._planned = [
            run for run in self._planned if run.level != level or not np.array_equal(run.z, z)
        ]

    def begin(self) -> tuple[int, PlannedRun]:
        """Begin the next run; its number counts from 0."""
        run, number = self._planned.pop(0), self._begun
        self._begun += 1
        self._out[number] = run
        if run.awaited:
            self._awaited.add(number)
        self.spent[run.level] += self.costs[run.level]
        return number, run

    def end(self, number: int) -> PlannedRun:
        """Take a run off those that are out."""
        self._awaited.discard(number)
        return self._out.pop(number)

    def await_no_more(self) -> None:
        """Let the runs that are out come in when they will."""
        self._awaited.clear()

    def out_at(self, level: int) -> list[Array]:
        """Designs (d,) that are out at a level."""
        return [run.z for run in self._out.values() if run.level == level]
