"""What a calibration found, as `calibration.json` keeps it; all values in SI units."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Literal

from mfopt.files.result_file import read_result

FILE = "calibration.json"  # in the run directory
LEAST_SQUARES = "least-squares.json"  # the result of a fit without intervals
FIT_COST = "fit-cost.json"  # beside it, because it differs whenever the same fit is made again

UNLIKELY, LIKELY = 0.001, 0.99  # probabilities beyond are only said to be so

SEEN = 2.0  # standard deviations, from which an error is beyond doubt

Edge = Literal["lower", "upper"]


@dataclass(frozen=True, slots=True)
class Found:
    """One parameter."""

    name: str
    unit: str
    low: float  # of the range
    high: float
    best: float  # the most likely draw; says nothing of a parameter that is not determined
    mean: float
    interval: tuple[float, float]  # 90 %
    share: float  # width of the interval over that of the prior
    determined: bool  # narrow, and not at the end of a range in a model that does not fit
    asked: bool  # False: left free because nobody knows it exactly
    log: bool  # True: its logarithm is spread evenly
    edge: Edge | None  # end of the range at which the draws pile up


@dataclass(frozen=True, slots=True)
class Direction:
    """A combination of parameters, by how much the recordings narrow it."""

    weights: Mapping[str, float]  # by parameter, in standard deviations of the prior
    ratio: float  # standard deviation of the posterior over that of the prior


@dataclass(frozen=True, slots=True)
class Recorded:
    """One recording as it was read."""

    name: str
    held_out: bool  # True: only predicted, never fitted
    conditions: Mapping[str, float | str]
    repeats: int
    duration: float = 0.0  # [s] of the longest series; 0 if there is none
    samples: Mapping[str, int] = field(default_factory=dict)  # of all repeats, by channel


@dataclass(frozen=True, slots=True)
class Compared:
    """A channel of a recording beside the simulations of the posterior."""

    recording: str
    held_out: bool
    channel: str
    unit: str
    times: list[float] | None  # [s]; None for a number
    recorded: list[float]  # mean over the repeats
    simulated: list[float]  # mean
    low: list[float]  # 90 % of single runs
    high: list[float]
    expected: list[float]  # 1 sd of recorded less simulated, from all errors
    error: float  # rms of recorded less simulated, over that of `expected`


@dataclass(frozen=True, slots=True)
class Measured:
    """Measurement noise of a channel: autocovariance sigma^2 exp(-|dt| / autocorrelation_time)."""

    channel: str
    unit: str
    sigma: float  # 1 sd
    sigma_range: tuple[float, float]  # 90 % interval, or bounds if found from one recording
    autocorrelation_time: float  # [s]; 0: independent from sample to sample
    found: str  # from what, in words


@dataclass(frozen=True, slots=True)
class EmulatorCheck:
    """The emulator of a fitted recording beside runs that it did not see."""

    recording: str
    fresh: bool  # True: runs of the posterior, made after the fit. False: its own, left out in turn
    runs: int
    held: float  # share of the 90 % intervals of its scores that hold the run
    squared: float  # mean square of run less prediction over its standard deviation; 1: as it says
    by_chance: float  # the largest `squared` that chance explains
    error: float  # rms of run less prediction over scatter of one run and measurement noise

    @property
    def doubt(self) -> float:
        """What the emulator allows for its error, over scatter of one run and measurement noise."""
        return self.error / math.sqrt(self.squared) if self.squared > 0.0 else 0.0

    @property
    def too_sure(self) -> bool:
        """Whether runs lie farther from the emulator than it says."""
        return self.squared > self.by_chance


@dataclass(frozen=True, slots=True)
class Offset:
    """An error of zero, scale or clock that is constant in a recording, recorded less true."""

    recording: str
    error: str  # which one, in words
    unit: str
    stated: float  # 1 sd that the case gives
    found: float  # mean, given all recordings
    sd: float  # 1 sd of that

    @property
    def notable(self) -> bool:
        """Whether it is larger than stated, and seen beyond doubt."""
        return abs(self.found) > max(self.stated, SEEN * self.sd)


@dataclass(frozen=True, slots=True)
class LeftOut:
    """A fit of the same runs in which one error does not count."""

    error: str
    intervals: Mapping[str, tuple[float, float]]  # 90 %, by parameter
    misfit: float


@dataclass(frozen=True, slots=True)
class Advice:
    """What the recording of one possible experiment would tell."""

    name: str
    narrower: Mapping[str, float]  # interval of each parameter afterwards over today's
    failed: int  # of its runs


@dataclass(frozen=True, slots=True)
class Summary:
    """A whole calibration."""

    name: str
    parameters: tuple[Found, ...]
    directions: tuple[Direction, ...]  # the best determined first
    combinations: list[str]  # known much better, or much worse, than single parameters; in words
    trade_offs: list[str]  # parameters that stand in for each other; in words
    correlation: list[list[float]]
    draws: list[list[float]]  # of the posterior, equally likely; a row a draw
    log_evidence: float
    misfit: float
    freedom: int
    probability: float  # of a larger misfit if the model is right
    fits: bool  # False: that probability is too small, or a fitted recording is too far off
    recordings: tuple[Recorded, ...]
    compared: tuple[Compared, ...]
    noise: tuple[Measured, ...]
    runs: int
    failed: int
    cpu_s: float
    emulators: tuple[EmulatorCheck, ...]  # two of each fitted recording
    without: tuple[LeftOut, ...]  # fits without an error; empty if they were not asked for
    advice: tuple[Advice, ...]  # on further recordings; empty if it was not asked for
    further: list[str]  # which further recording would determine what is open; in words
    warnings: list[str]  # why the values may be wrong; in words
    check: list[str]  # that the emulators know their errors; empty if one does not
    words: list[str]  # the result, one sentence a line
    notes: tuple[str, ...] = ()  # what was mended on reading, each after the files it holds for
    offsets: tuple[Offset, ...] = ()  # of fitted recordings; empty if the case states no such error


def chance(probability: float) -> str:
    """A probability of a larger misfit in words, to two digits."""
    if probability < UNLIKELY:
        return f"below {UNLIKELY}"
    return f"above {LIKELY}" if probability > LIKELY else f"{probability:#.2g}"


def as_json(its: Summary) -> str:
    """The summary as JSON."""
    return json.dumps(asdict(its), indent=1)


def fit_cost_as_json(cpu_s: float) -> str:
    """What emulators and posterior cost, beside the runs."""
    return json.dumps({"cpu_s": round(cpu_s, 1)})


def read_fit_cost(directory: Path) -> float | None:
    """CPU time [s] of emulators and posterior; None if the run directory does not tell it."""
    try:
        return float(json.loads((directory / FIT_COST).read_bytes())["cpu_s"])
    except (OSError, ValueError, KeyError, TypeError):
        return None


def read_summary(directory: Path) -> Summary:
    """The summary that a run directory holds.

    Raises:
        ConfigError: if there is none, or the file is damaged.
    """
    again = f"mfopt calibrate CASE --directory {directory} --resume writes it"
    missing = f"the calibration has not ended, or is one by least squares; without --method {again}"
    return read_result(directory / FILE, Summary, missing=missing, again=again)
