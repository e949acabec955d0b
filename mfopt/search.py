"""The protocol of a search, and the plan of levels that the fixed-ladder searches follow."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from mfopt.errors import ConfigError
from mfopt.evaluation import Candidate, Generation


class Search(Protocol):
    """Ask/tell search. It knows no simulator: it proposes candidates and is told their values."""

    @property
    def generation(self) -> Generation:
        """The generation that the next `ask` belongs to; it names the objective to be told."""

    def ask(self) -> list[Candidate]:
        """Propose the candidates of the next generation.

        Raises:
            SimulationError: if no possible design can be found.
        """

    def tell(self, candidates: Sequence[Candidate], values: Sequence[float]) -> None:
        """Learn the objective values of the candidates; infinite for a failed run."""

    def should_stop(self) -> str | None:
        """Why the search is over, in words; None while it goes on."""

    @property
    def work_left(self) -> Sequence[tuple[str, int]]:
        """Runs that the plan still holds, by level, this generation included."""


@dataclass(frozen=True, slots=True)
class Stage:
    """A stretch of the search on one level."""

    level: str
    generations: int
    population_size: int
    sigma: float = 0.2  # initial step size in the unit cube
    objective: str = "dispersion"
    seeds: int = 1  # generations rotate over so many seeds; one generation shares one

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
