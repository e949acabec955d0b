"""What a search asks for, and what became of it."""

import math
from dataclasses import dataclass
from typing import Literal

from mfopt.arrays import Array
from mfopt.records.outcome import Outcome

HALF_WIDTH = 1.96  # standard deviations on either side: 95 % of a normal distribution
LARGEST = 700.0  # exponent that a float bears

Purpose = Literal[
    "check",  # the start design, to see that a level runs
    "start",  # a design that the search may start from
    "search",
    "finalist",  # a design that may be the best, at the target level
    "confirm best",
    "confirm baseline",
    "reference best",
    "reference baseline",
    "design",  # of a calibration: parameters spread over their ranges
    "refine",  # parameters that the recordings leave possible
    "predict",  # the same, to be compared with the recordings
    "possible",  # the same, under the conditions of an experiment that nobody has made
]


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """One run to be made: a design, where to evaluate it, and with which seed."""

    index: int  # place in the sequence of all evaluations of the run
    x: Array  # (d,) physical units
    level: str
    seed: int
    generation: int = 0  # 0 outside of generations
    purpose: Purpose = "search"


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """A candidate with its outcome and the objective value it was told with."""

    candidate: Candidate
    outcome: Outcome
    objective: float  # infinite if the run failed


@dataclass(frozen=True, slots=True)
class Reference:
    """The engine that best and baseline are run on once more, or why there is none."""

    level: str = ""  # name of the level on that engine; empty if there is none
    engine: str = ""
    version: str = ""
    why_not: str | None = None  # why the runs that the study asks for are skipped


@dataclass(frozen=True, slots=True)
class Generation:
    """One generation of a search, as the report needs it."""

    number: int  # counted from 1 over the whole run
    level: str
    restart: int  # how many restarts came before
    sigma: float  # step size in the unit cube
    population_size: int
    objective: str  # name of the objective that ranks it
    why: str = ""  # why the search started anew here; empty if it went on


@dataclass(frozen=True, slots=True)
class Insight:
    """What one finished generation of a search taught, as the report needs it."""

    generation: int
    certainty: float  # of the ranking that CMA-ES was told; 1: every posterior draw ranks alike
    runs: int  # candidates of the generation that were run
    level: str  # that the following is said of
    best: tuple[float, ...]  # (d,) recommended design, physical units
    mean: float  # its noise-free objective, as believed
    deviation: float  # standard deviation of that belief
    positive: bool = False  # every value told was above 0, as standard deviations and times are

    @property
    def exact(self) -> bool:
        """Whether runs do not scatter, so that the objective is known."""
        return self.deviation == 0.0

    @property
    def interval(self) -> tuple[float, float]:
        """Bounds that hold the noise-free objective with 95 % probability, as believed.

        Where the objective is positive they are the mean times and over the same factor,
        exp(1.96 sqrt(log(1 + deviation^2 / mean^2))), so positive too.
        """
        if self.positive and self.mean > 0.0:
            ratio = self.deviation / self.mean
            factor = math.exp(min(LARGEST, HALF_WIDTH * math.sqrt(math.log1p(ratio * ratio))))
            return self.mean / factor, self.mean * factor
        half = HALF_WIDTH * self.deviation
        return self.mean - half, self.mean + half
