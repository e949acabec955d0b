"""A fit by least squares with a simulation for every value: L-BFGS-B.

What many calibrations of grains do. It is here to be compared with: it gives one set of parameters
and no intervals, and says nothing of what the recordings leave open.

Source: Byrd, Lu, Nocedal & Zhu 1995, doi:10.1137/0916069.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from calibration.observed import Observed, observed
from calibration.recordings.case import Case
from calibration.recordings.records import Noise, Recording
from calibration.runs import (
    Evaluate,
    Predicted,
    candidates,
    check_times,
    end_of,
    flaw,
    most_frequent,
    predicted,
    predictions_of_each,
    seeing,
)
from calibration.summary import compared
from calibration.words import error_in_words
from mfopt.arrays import Array, frozen
from mfopt.errors import ConfigError, SimulationError
from mfopt.records.calibration import LEAST_SQUARES, Compared
from mfopt.records.evaluation import Evaluation
from mfopt.records.rig import Channel

FAILED = 1e3  # square of parameters that cannot be run
STEP = 0.05  # of each range, for the gradient: smaller ones drown in the noise of packings


@dataclass(frozen=True, slots=True, eq=False)
class LeastSquares:
    """The parameters with the smallest sum of squares that was found."""

    best: Array  # (d,) in the parameters' units
    squares: float  # mean square of the difference, over the recorded range of each channel
    predicted: tuple[Predicted, ...]
    evaluations: tuple[Evaluation, ...]


def fit_least_squares(
    case: Case, noises: Mapping[str, Noise], evaluate: Evaluate, runs: int
) -> LeastSquares:
    """Fit the parameters of a case by L-BFGS-B with forward differences.

    It starts in the middle of the ranges. Where it ends it starts anew from a random place, until
    the runs are spent.

    Args:
        case: with at least one recording that is fitted.
        noises: measurement noise by channel.
        evaluate: makes runs, in the order given.
        runs: to be made in all.

    Raises:
        ConfigError: if the runs are too few.
        SimulationError: if no parameters could be run.
    """
    count = predictions_of_each(case, runs)
    squares = Squares(case, noises, evaluate, runs - count * len(case.recordings))
    dimension = len(case.parameters)
    if squares.left < dimension + 1:
        least = (dimension + 1) * len(case.fitted) + count * len(case.recordings)
        raise ConfigError(f"{runs} runs are too few for one gradient; give at least {least}")
    rng = np.random.default_rng(case.seed)
    start = np.full(dimension, 0.5)
    bounds = [(0.0, 1.0)] * dimension
    while squares.left >= dimension + 1:
        spent = len(squares.made)
        try:
            minimize(squares.with_gradient, start, jac=True, method="L-BFGS-B", bounds=bounds)
        except _SpentError:
            break
        if len(squares.made) == spent:
            break
        start = rng.random(dimension)
    if squares.best is None:
        raise SimulationError(
            "every run failed; mend the simulation, or change the ranges to where it works. "
            f"{most_frequent(squares.flaws)}"
        )
    z, made = squares.best[None], len(squares.made)
    beside, last = predicted(case, seeing(case, noises), evaluate, z, count, made)
    x = last[0].candidate.x
    return LeastSquares(frozen(x), squares.lowest, beside, (*squares.made, *last))


class _SpentError(Exception):
    """The runs are spent."""


@dataclass(slots=True, eq=False)
class Squares:
    """Mean square of simulated less recorded, over the recorded range of each channel.

    One run for each fitted recording; the packings are the same for all parameters.
    """

    case: Case
    noises: Mapping[str, Noise]
    evaluate: Evaluate
    runs: int
    made: list[Evaluation] = field(default_factory=list)
    best: Array | None = None  # (d,) in the unit cube
    lowest: float = np.inf
    seen: dict[str, Observed] = field(default_factory=dict)  # by recording

    @property
    def left(self) -> int:
        """How many more parameters can be run."""
        return (self.runs - len(self.made)) // len(self.case.fitted)

    def __call__(self, z: Array) -> Array:
        """Values (n,) at parameters (n, d) in the unit cube; infinite where a run failed.

        Raises:
            _SpentError: if there are not enough runs left.
        """
        if len(z) > self.left:
            raise _SpentError
        points = [(recording, z) for recording in self.case.fitted]
        asked = candidates(self.case.parameters, points, len(self.made), "search")
        packing = {r.name: i for i, r in enumerate(self.case.fitted, start=1)}
        new = self.evaluate([replace(c, seed=packing[c.level]) for c in asked])
        self.made += new
        squares = np.array([self._square(e) for e in new])  # the recordings in turn
        values = squares.reshape(len(z), -1).mean(axis=1)
        if values.min() < self.lowest:
            self.lowest, self.best = float(values.min()), z[values.argmin()].copy()
        return np.asarray(values)

    def with_gradient(self, z: Array) -> tuple[float, Array]:
        """Value and gradient (d,) at z (d,), by differences that stay in the cube."""
        steps = np.where(z + STEP <= 1.0, STEP, -STEP)
        values = self(np.vstack([z, z + np.diag(steps)]))
        if not np.isfinite(values[0]):
            return FAILED, np.zeros(len(z))
        values = np.where(np.isfinite(values), values, values[0])
        return float(values[0]), (values[1:] - values[0]) / steps

    @property
    def flaws(self) -> list[str | None]:
        """Why each run cannot be compared; None of one that can."""
        return [flaw(its, self._recording(its)) for its in self.made]

    def _recording(self, its: Evaluation) -> Recording:
        return next(r for r in self.case.fitted if r.name == its.candidate.level)

    def _square(self, its: Evaluation) -> float:
        recording = self._recording(its)
        if flaw(its, recording) is not None:
            return np.inf
        if recording.name not in self.seen:
            check_times(recording, [its])
            measurement, end = self.case.measurement, end_of([its])
            self.seen[recording.name] = observed(recording, measurement, self.noises, end)
        seen = self.seen[recording.name]
        simulated, recorded = seen.split(seen.row(its.outcome.raw)), seen.split(seen.values)
        squares = [
            np.mean((simulated[channel] - values) ** 2) / _size(values) ** 2
            for channel, values in recorded.items()
        ]
        return float(np.mean(squares))


def _size(values: Array) -> float:
    """Range of a recorded series, or the number itself."""
    return float(np.ptp(values)) or float(np.abs(values).max()) or 1.0


@dataclass(frozen=True, slots=True)
class LeastSquaresSummary:
    """A fit by least squares, as numbers."""

    name: str
    parameters: Mapping[str, float]
    squares: float
    compared: tuple[Compared, ...]
    runs: int
    failed: int
    cpu_s: float

    @property
    def as_json(self) -> str:
        """All of it as JSON."""
        return json.dumps(asdict(self), indent=1)

    @property
    def in_words(self) -> list[str]:
        """What an engineer wants to know, one sentence a line."""
        return [
            *(f"{name} = {value:.3g}" for name, value in self.parameters.items()),
            f"Least squares give no intervals; the difference is {math.sqrt(self.squares):.3g} "
            "of the recorded range (root mean square)",
            *map(error_in_words, self.compared),
            f"{self.runs} simulations, {self.failed} failed, {self.cpu_s:.0f} s of CPU",
        ]


def least_squares_summary(
    its: LeastSquares, case: Case, channels: Mapping[str, Channel]
) -> LeastSquaresSummary:
    """Sum up a fit."""
    outcomes = [e.outcome for e in its.evaluations]
    names = [p.name for p in case.parameters]
    return LeastSquaresSummary(
        name=case.name,
        parameters=dict(zip(names, map(float, its.best), strict=True)),
        squares=its.squares,
        compared=tuple(c for p in its.predicted for c in compared(p, {}, channels)),
        runs=len(outcomes),
        failed=sum(not outcome.finished for outcome in outcomes),
        cpu_s=sum(outcome.cpu_s for outcome in outcomes),
    )


def read_least_squares(path: Path) -> LeastSquaresSummary:
    """The fit that a run directory holds.

    Raises:
        ConfigError: if the file cannot be read.
    """
    try:
        told = json.loads((path / LEAST_SQUARES).read_text())
        return LeastSquaresSummary(
            **{**told, "compared": tuple(Compared(**its) for its in told["compared"])}
        )
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise ConfigError(
            f"cannot read {path / LEAST_SQUARES}: {error}; mfopt calibrate CASE --method lbfgsb "
            f"--directory {path} --resume writes it again"
        ) from error
