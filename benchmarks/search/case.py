"""One case to be searched, the meter that counts what a search spends on it, and its trace."""

import math
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Function = Callable[[Array], Any]  # (d,) or (n, d) -> noise-free value or (n,) values
Noise = Callable[[float, np.random.Generator], float]  # value above the optimum -> measured

CELLS_PER_DECADE = 20  # resolution in which a trace keeps what is left of the first gap
LAST_CELL = 6 * CELLS_PER_DECADE  # 1e-6 of the first gap: solved
TUNING = range(1, 21)  # instances to tune a method on; 6-20 check what was decided on 1-5
FIRST_REPORTED = 101  # from here on instances that are reported and never tuned on


class Spent(Exception):
    """The meter raises it instead of a further evaluation: budget spent, or nothing left to gain.

    Only a noise-free case of one level ends because it is solved: elsewhere a hit may not last.
    """


def exact(gap: float, rng: np.random.Generator) -> float:
    """No noise."""
    return gap


@dataclass(frozen=True, slots=True, eq=False)
class Case:
    """A function to be minimised over a box, on one level or several; the last is the target."""

    name: str  # such as "ladder/f10/b1/n30"; with the instance it says all
    instance: int
    lower: Array  # (d,)
    upper: Array  # (d,)
    x0: Array  # (d,) the start that every search is given
    levels: tuple[Function, ...]  # noise-free
    costs: tuple[float, ...]
    optimum: float  # of the target level
    noise: Noise = exact
    sigma0: float = 0.2  # first step size as a share of the box's width

    @property
    def dimension(self) -> int:
        """Number of variables."""
        return self.x0.size

    @property
    def noisy(self) -> bool:
        """Whether two evaluations of one design differ."""
        return self.noise is not exact

    @property
    def target(self) -> int:
        """Index of the target level."""
        return len(self.levels) - 1

    @property
    def z0(self) -> Array:
        """The start in the unit cube, (d,)."""
        return np.asarray((self.x0 - self.lower) / (self.upper - self.lower))

    def to_x(self, z: ArrayLike) -> Array:
        """Map the unit cube to the box, (..., d); what lies outside moves to its edge."""
        inside = np.clip(np.asarray(z, dtype=float), 0.0, 1.0)
        return np.asarray(self.lower + inside * (self.upper - self.lower))

    def evaluate(self, x: Array, level: int, rng: np.random.Generator) -> float:
        """Measure the design `x` (d,) on a level, noise included."""
        return self.optimum + self.noise(float(self.levels[level](x)) - self.optimum, rng)

    def gap(self, x: Array) -> float:
        """Noise-free value on the target level above the optimum."""
        return float(self.levels[-1](x)) - self.optimum


@dataclass(frozen=True, slots=True)
class Trace:
    """What a search would have handed over at which cost.

    A cell k says that between 10**(-(k + 1) / 20) and 10**(-k / 20) of the first gap is left;
    an entry is kept where the cell changes.
    """

    costs: tuple[float, ...]  # cumulative cost at which the recommendation changed its cell
    cells: tuple[int, ...]
    levels: tuple[int, ...]  # level of the evaluation after which it changed
    runs: tuple[int, ...]  # evaluations by level
    cost: float  # all that was spent
    cpu_s: float = 0.0  # the search's own [s], evaluations left out
    slowest_s: float = 0.0  # longest ask + tell [s], where it was measured
    why: str = "budget spent"

    def __post_init__(self) -> None:
        if not len(self.costs) == len(self.cells) == len(self.levels):
            raise ValueError("costs, cells and levels of a trace must have the same length")


def cell_of(share: float) -> int:
    """Cell of the share of the first gap that is left; the larger the better."""
    if share <= 10.0 ** (-LAST_CELL / CELLS_PER_DECADE):
        return LAST_CELL
    return max(-CELLS_PER_DECADE, math.floor(-CELLS_PER_DECADE * math.log10(share) + 1e-9))


class Meter:
    """Evaluates designs of the unit cube, counts the cost and keeps the trace.

    Args:
        case: what is searched.
        budget: in units of the case's costs.
        seed: of the noise.
        follow_best: recommend the best value measured on the highest level used so far;
            otherwise the search itself says what it recommends.
        limit_s: processor time [s] that the search itself may take.
    """

    def __init__(
        self,
        case: Case,
        budget: float,
        seed: int,
        *,
        follow_best: bool,
        limit_s: float = math.inf,
    ) -> None:
        self.case = case
        self.budget = budget
        self.limit_s = limit_s
        self.cost = 0.0
        self.runs = [0] * len(case.levels)
        self.slowest_s = 0.0
        self._rng = np.random.default_rng((case.instance, seed))
        self._follow_best = follow_best
        self._best: tuple[int, float] = (-1, math.inf)  # level, value
        self._first_gap = case.gap(case.x0)
        self._costs, self._cells, self._levels = [0.0], [0], [0]
        self._began = time.process_time()
        self._evaluating_s = 0.0

    def __call__(self, z: ArrayLike, level: int | None = None, *, audit: bool = False) -> float:
        """Evaluate the design `z` (d,) on a level, the target if none is named.

        An audit costs as much, but its value is not taken for a recommendation.

        Raises:
            Spent: instead of an evaluation that would exceed the budget, or is of no use.
        """
        began = time.process_time()
        level = self.case.target if level is None else level
        if self.cost + self.case.costs[level] > self.budget * (1.0 + 1e-12):
            raise Spent("budget spent")
        if began - self._began - self._evaluating_s > self.limit_s:
            raise Spent("time limit")
        if self._cells[-1] == LAST_CELL and not self.case.noisy and self.case.target == 0:
            raise Spent("solved")
        self.cost += self.case.costs[level]
        self.runs[level] += 1
        value = self.case.evaluate(self.case.to_x(z), level, self._rng)
        if self._follow_best and not audit:
            best_level, best = self._best
            if level > best_level or (level == best_level and value < best):
                self._best = (level, value)
                self._record(z, level)
        self._evaluating_s += time.process_time() - began
        return value

    def recommend(self, z: ArrayLike, level: int | None = None) -> None:
        """Note that a user would now be handed the design `z` (d,)."""
        self._record(z, self.case.target if level is None else level)

    def trace(self, why: str = "budget spent") -> Trace:
        """What happened so far."""
        cpu = time.process_time() - self._began - self._evaluating_s
        return Trace(
            tuple(self._costs), tuple(self._cells), tuple(self._levels),
            tuple(self.runs), self.cost, cpu, self.slowest_s, why,
        )  # fmt: skip

    def _record(self, z: ArrayLike, level: int) -> None:
        cell = cell_of(self.case.gap(self.case.to_x(z)) / self._first_gap)
        if cell == self._cells[-1]:
            return
        if self.cost == self._costs[-1]:  # the later word at the same cost holds
            self._cells[-1], self._levels[-1] = cell, level
            return
        self._costs.append(self.cost)
        self._cells.append(cell)
        self._levels.append(level)


def spend(
    case: Case,
    budget: float,
    seed: int,
    method: Callable[[Meter], None],
    *,
    limit_s: float = math.inf,
) -> Trace:
    """Let a method run until nothing is left to spend.

    Recommended is the best value measured; under noise what the method says.
    """
    meter = Meter(case, budget, seed, follow_best=not case.noisy, limit_s=limit_s)
    why = "the method ended"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of cma: flat fitness, injected solutions; and others'
        try:
            method(meter)
        except Spent as spent:
            why = str(spent)
    return meter.trace(why)
