"""The protocol of a search, and the plan of levels that the fixed-ladder searches follow."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, Protocol, get_args

from mfopt.arrays import Array
from mfopt.checks import name_of, number, shown, whole
from mfopt.errors import ConfigError
from mfopt.records.evaluation import Candidate, Generation, Insight
from mfopt.records.level import Ladder
from mfopt.records.outcome import LARGEST_WORK, SMALLEST_WORK


class Search(Protocol):
    """Ask/tell search. It knows no simulator: it proposes candidates and is told their values.

    The same seed, and the same asks and tells in the same order, give the same search.
    """

    @property
    def generation(self) -> Generation:
        """The generation that the next `ask` belongs to; it names the objective to be told."""

    def ask(self, n: int | None = None) -> list[Candidate]:
        """Propose up to `n` candidates; fewer, or none, where values must be told first.

        Without `n`, all that can be proposed now.

        Raises:
            SimulationError: if no possible design can be found.
        """

    def tell(
        self,
        candidates: Sequence[Candidate],
        values: Sequence[float],
        counts: Array | None = None,
    ) -> None:
        """Learn the objective values of some candidates, in any order.

        Args:
            values: infinite for a failed run; what is no number counts as failed.
            counts: (n, c) soft-constraint terms contained in the values.
        """

    def should_stop(self) -> str | None:
        """Why the search is over, in words; None while it goes on."""

    def recommended(self) -> Array | None:
        """The design (d,) to build, as far as the search knows; None while it knows none."""

    def finalists(self, n: int) -> list[Array]:
        """Up to `n` different designs (d,) that may be the best, the recommended one first."""

    @property
    def insight(self) -> Insight | None:
        """What the last finished generation taught; None if the search does not say."""

    @property
    def work_left(self) -> Sequence[tuple[str, int]]:
        """Runs that are still to be asked for, by level."""


Reevaluate = Literal["none", "ranks", "elite"]

POPULATION_SIZES = (2, 1000)  # a covariance of all candidates is factored in every generation
MOST_GENERATIONS = 100_000
MOST_SEEDS = 10_000  # below `phases.FINALIST_SEED`, so that what comes after is on fresh ones
MOST_SEED = 2**53  # of a search; every program reads so large whole numbers exactly from JSON
SIGMAS = (1e-6, 1.0)  # first step sizes
MOST_BUDGET = 1e6  # target runs
MOST_WORKERS = 4096


def check_sigma(sigma: float, where: str = "") -> None:
    """Make sure that a first step size fits the unit cube.

    Raises:
        ConfigError: if it does not.
    """
    try:
        number(f"{where}sigma", sigma, *SIGMAS)
    except ConfigError as error:
        raise ConfigError(f"{error} (a step in the unit cube; 0.2 is a good start)") from None


def check_reevaluate(reevaluate: str, where: str = "") -> None:
    """Make sure that the rule for replicates exists.

    Raises:
        ConfigError: if it does not.
    """
    if reevaluate not in get_args(Reevaluate):
        raise ConfigError(
            f"{where}reevaluate = {shown(reevaluate)} is none of {', '.join(get_args(Reevaluate))}"
        )


@dataclass(frozen=True, slots=True)
class Stage:
    """A stretch of the search on one level."""

    level: str
    generations: int
    population_size: int
    sigma: float = 0.2  # initial step size in the unit cube
    objective: str = "dispersion"
    seeds: int = 1  # generations rotate over so many seeds; one generation shares one
    reevaluate: Reevaluate = "none"  # which candidates are run again

    def __post_init__(self) -> None:
        name_of("a level", self.level)
        where = f"stage on {self.level!r}: "
        whole(where + "generations", self.generations, 1, MOST_GENERATIONS)
        whole(where + "population_size", self.population_size, *POPULATION_SIZES)
        whole(where + "seeds", self.seeds, 1, MOST_SEEDS)
        check_sigma(self.sigma, where)
        check_reevaluate(self.reevaluate, where)

    @property
    def runs(self) -> int:
        """Runs that the stage may spend, replicates included."""
        return self.generations * self.population_size


def default_population_size(d: int) -> int:
    """Candidates per generation in `d` variables (Hansen, arXiv:1604.00772, eq. 48)."""
    return 4 + int(3.0 * math.log(d))


CHEAPEST = 1.0 / 512.0  # of a target run; below it the search's own work is what costs


@dataclass(frozen=True, slots=True)
class Rung:
    """A level as the assisted search sees it.

    `rungs` makes them of a ladder, where a run counts as at least 1/512 of a target run.

    Raises:
        ConfigError: if the cost is no number from 1e-12 to 1e18.
    """

    level: str
    cost: float  # of one run, in the unit of the budget

    def __post_init__(self) -> None:
        name_of("a level", self.level)
        check_work(f"level {self.level!r}: cost", self.cost)


def check_work(name: str, work: float) -> float:
    """The work or cost of a run as a number.

    Raises:
        ConfigError: if it is none, or so small or large that sums and quotients would overflow.
    """
    return number(name, work, SMALLEST_WORK, LARGEST_WORK)


def rungs(ladder: Ladder, x: Array) -> tuple[Rung, ...]:
    """The levels with their costs at the design `x` (d,), in runs of the target level.

    A level that costs less than 1/512 of a target run counts as 1/512: below that, the search's
    own work is what costs.

    Raises:
        ConfigError: if the work of a level is no number from 1e-12 to 1e18, or more than that of
            the level after it.
    """
    works = {
        level.name: check_work(f"level {level.name!r}: work", level.work(x)) for level in ladder
    }
    full = works[ladder.top.name]
    found = tuple(Rung(name, max(work / full, CHEAPEST)) for name, work in works.items())
    check_rungs(found)
    return found


def check_rungs(rungs: Sequence[Rung]) -> None:
    """Make sure that there is a level, and that none costs more than the one after it.

    Raises:
        ConfigError: if not.
    """
    if not rungs:
        raise ConfigError("the search has no level: give at least one")
    for rung, after in pairwise(rungs):
        if rung.cost > after.cost:
            raise ConfigError(
                f"a run at level {rung.level!r} costs {rung.cost:g}, more than one at "
                f"{after.level!r} after it, {after.cost:g} (in runs of {rungs[-1].level!r}); list "
                "the levels from cheap to dear, the target last, and leave out what is dearer"
            )


def affordable(budget: float | Sequence[float], rungs: Sequence[Rung]) -> tuple[float, ...]:
    """The budget, or the budgets one after the other, that afford a run at the target.

    Raises:
        ConfigError: if the first affords none, or one is not larger than the one before it.
    """
    several = isinstance(budget, Sequence) and not isinstance(budget, str)
    given: Sequence[float] = budget if several else [budget]  # type: ignore[assignment, list-item]
    target = rungs[-1]
    budgets = tuple(number("budget", its, highest=MOST_BUDGET * target.cost) for its in given)
    if not budgets:
        raise ConfigError("budget = [] is none; give at least one")
    if budgets[0] < target.cost:
        raise ConfigError(
            f"budget = {budgets[0]:g} is below the cost of one run at {target.level!r}, "
            f"{target.cost:g}; raise it"
        )
    for before, after in pairwise(budgets):
        if after <= before:
            raise ConfigError(f"budget = {after:g} must be above {before:g}, the one before it")
    return budgets


def usable(value: float) -> float:
    """A value as a search keeps it: what is nan or -inf is that of a failed run."""
    return float(value) if -math.inf < value else math.inf


def window(workers: int) -> int:
    """Candidates that should be out at a time, so that no worker waits for a slow run."""
    return workers + workers // 2
