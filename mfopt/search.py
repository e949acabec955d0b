"""The protocol of a search, and the plan of levels that the fixed-ladder searches follow."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, get_args

from mfopt.arrays import Array
from mfopt.errors import ConfigError
from mfopt.evaluation import Candidate, Generation, Insight
from mfopt.level import Ladder


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
            values: infinite for a failed run.
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
        for name, lowest in (("generations", 1), ("population_size", 3), ("seeds", 1)):
            if getattr(self, name) < lowest:
                raise ConfigError(
                    f"stage on {self.level!r}: {name} = {getattr(self, name)} must be "
                    f"at least {lowest}"
                )
        if not 0.0 < self.sigma <= 1.0:
            raise ConfigError(
                f"stage on {self.level!r}: sigma = {self.sigma} must be above 0 and at most 1 "
                "(a step in the unit cube; 0.2 is a good start)"
            )
        if self.reevaluate not in get_args(Reevaluate):
            raise ConfigError(
                f"stage on {self.level!r}: reevaluate = {self.reevaluate!r} is none of "
                f"{', '.join(get_args(Reevaluate))}"
            )

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
    """A level as the assisted search sees it."""

    level: str
    cost: float  # of one run, in the unit of the budget

    def __post_init__(self) -> None:
        if not (math.isfinite(self.cost) and self.cost > 0.0):
            raise ConfigError(f"level {self.level!r}: cost = {self.cost} must be above 0")


def rungs(ladder: Ladder, x: Array) -> tuple[Rung, ...]:
    """The levels with their costs at the design `x` (d,), in runs of the target level."""
    full = ladder.top.work(x)
    return tuple(Rung(level.name, max(level.work(x) / full, CHEAPEST)) for level in ladder)


def window(workers: int) -> int:
    """Candidates that should be out at a time, so that no worker waits for a slow run."""
    return workers + workers // 2
