"""What a diagnosis found, as `diagnosis.json` keeps it; all values in SI units."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

from mfopt.files.result_file import read_result

FILE = "diagnosis.json"  # in the run directory

Kind = Literal["nothing", "named", "set", "partly", "unknown"]


@dataclass(frozen=True, slots=True)
class Suspected:
    """An effect that may be missing, and how likely it is."""

    name: str
    measuring: bool  # True: of camera or sensor; False: of grains or machine
    meaning: str
    unit: str
    probability: float  # that it is there, alone or with another one
    size: float  # with the likeliest effects if it is one of them, else where it is there alone
    interval: tuple[float, float]  # 90 %
    gain: float  # log evidence over that of nothing, alone
    like: tuple[str, ...]  # effects that these recordings cannot tell from it
    faint: bool  # True: these recordings cannot show it even at full strength
    at_end: bool  # True: its size is the end of its range


@dataclass(frozen=True, slots=True)
class BaseParameter:
    """A fitted parameter, without any effect and with the likeliest one."""

    name: str
    unit: str
    before: float
    after: float


@dataclass(frozen=True, slots=True)
class Value:
    """A parameter of the simulation with the likeliest effects."""

    name: str
    unit: str
    value: float
    interval: tuple[float, float]  # 90 %; both are the value where it was not fitted
    determined: bool  # whether the recordings say something of it


@dataclass(frozen=True, slots=True)
class Place:
    """One channel of one recording over a window of time."""

    recording: str
    channel: str
    unit: str
    start: float  # [s]
    end: float
    low: float  # range of the recorded values
    high: float
    difference: float  # [standard deviations of the mean of the repeats]
    excess: float  # what the recordings have more than the simulation
    probability: float  # that some place stands out as much without any mismatch
    stands_out: bool


@dataclass(frozen=True, slots=True)
class Vote:
    """How well a recording is predicted from the others with an effect."""

    effect: str
    recording: str
    gain: float  # log predictive density with the effect less that without
    against: bool


@dataclass(frozen=True, slots=True)
class Beside:
    """A channel of a recording beside simulations without and with the likeliest effect."""

    recording: str
    held_out: bool
    channel: str
    unit: str
    times: list[float] | None  # [s]; None for a number
    recorded: list[float]  # mean over the repeats
    before: list[float]
    after: list[float]
    sd: list[float]  # of the mean of the repeats


@dataclass(frozen=True, slots=True)
class HeldOut:
    """Errors of the prediction of a recording that took no part, in standard deviations."""

    recording: str
    before: float
    before_range: tuple[float, float]  # 90 %
    after: float
    after_range: tuple[float, float]
    decoy: float  # with the likeliest of all other effects
    decoy_name: str
    discrepancy: float  # with a shared Gaussian process instead of an effect


@dataclass(frozen=True, slots=True)
class Next:
    """What one recording more is expected to tell."""

    experiment: str
    channels: tuple[str, ...]
    gain: float  # expected log evidence between the hypotheses that are left
    apart: tuple[str, str]


@dataclass(frozen=True, slots=True)
class Rerun:
    """A stored design with the physics of the study and with the corrected one."""

    design: int  # number of its evaluation in the study
    before: float | None  # mean objective over the seeds; None if a run failed
    after: float | None


@dataclass(frozen=True, slots=True)
class Consequence:
    """What the corrected simulation changes for a study."""

    study: str
    unit: str  # of the objective
    designs: tuple[Rerun, ...]
    order: float  # Kendall's rank correlation of both; 1: the same order
    best_before: int  # number of the design
    best_after: int
    lost: float | None  # by keeping the best design of before


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """A whole diagnosis."""

    name: str
    kind: Kind
    effects: tuple[str, ...]  # the names, or those of the set
    probability: float  # of what is said
    why: str  # no name is given; empty if one is
    likeliest: str  # the likeliest effects, with which held-out recordings are predicted
    explained: float | None  # share of the misfit beyond chance by effects that are a part of it
    mismatch: float  # p-value: how often recordings without a mismatch look as bad
    gain: float  # of the best effect, in log likelihood
    gain_at_5: float  # which recordings without a mismatch reach in 5 % of the cases
    unexplained: float  # p-value of the misfit that the likeliest hypothesis leaves
    rest: float | None  # p-value of all that lies outside of the places that stand out
    nothing: float  # probability that nothing is missing
    other: float  # probability that something is missing which is no known effect
    suspects: tuple[Suspected, ...]  # the likeliest first
    parameters: tuple[BaseParameter, ...]
    model: tuple[Value, ...]  # the corrected simulation
    places: tuple[Place, ...]
    votes: tuple[Vote, ...]
    beside: tuple[Beside, ...]
    held_out: tuple[HeldOut, ...]
    next: tuple[Next, ...]
    consequence: Consequence | None  # None if no study was given, or nothing was named
    library_runs: int
    runs: int  # that confirm
    failed: int
    cpu_s: float
    words: list[str]  # the result, one sentence a line


def as_json(its: Diagnosis) -> str:
    """The diagnosis as JSON."""
    return json.dumps(asdict(its), indent=1)


def read_diagnosis(directory: Path) -> Diagnosis:
    """The diagnosis that a run directory holds.

    Raises:
        ConfigError: if there is none, or the file is damaged.
    """
    again = f"mfopt diagnose CASE --directory {directory} --resume writes it"
    missing = f"the diagnosis has not ended; {again}"
    return read_result(directory / FILE, Diagnosis, missing=missing, again=again)
