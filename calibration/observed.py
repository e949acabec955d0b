"""What a recording and a run are compared on: the same points in time, in one row.

The samples of a recording are averaged around each point with triangular weights and a local line,
so that all of them count, and the mean over the repeats is taken. A run is interpolated at the
times of the samples and averaged with the same weights: both are flattened alike.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calibration.recordings.case import Measurement
from calibration.recordings.noise import noise_of_sums
from calibration.recordings.records import Noise, Recording, Repeat
from mfopt.arrays import AnyArray, Array, frozen
from mfopt.errors import ConfigError
from mfopt.records.rig import TIME

POINTS = 40  # in time of each series
LONGEST_START = 0.2  # [of the duration] 1 sd of an unknown start
FEWEST_SAMPLES = 2  # under the weights of one point


@dataclass(frozen=True, slots=True, eq=False)
class Block:
    """The points of one channel in a row."""

    channel: str
    times: Array | None  # (m,) [s]; None for a number, which has one point
    samples: Array | None = None  # (n,) [s] of all repeats, one after the other
    weights: Array | None = None  # (m, n) of the samples in the mean at each point

    @property
    def size(self) -> int:
        """Number of points."""
        return 1 if self.times is None else len(self.times)


@dataclass(frozen=True, slots=True, eq=False)
class Observed:
    """A recording as one row of values, and what is known of their errors."""

    name: str
    blocks: tuple[Block, ...]
    values: Array  # (p,) mean over the repeats
    repeats: int
    measured: Array  # (p, p) covariance of the measurement noise of the mean
    constant: Array  # (p, r) factor of errors that are constant in a recording: zero and scale
    clock_error: float  # relative, 1 sd
    start_sd: float  # [s] 1 sd of where time 0 lies
    each: Array | None = None  # (r, p) values of every repeat; None if some lack a channel

    @property
    def times(self) -> Array:
        """Time [s] of each point (p,); 0 for numbers."""
        return np.concatenate([np.zeros(1) if b.times is None else b.times for b in self.blocks])

    @property
    def end(self) -> float:
        """Time of the last point [s]."""
        return float(self.times.max())

    def row(self, raw: Mapping[str, AnyArray]) -> Array:
        """The values (p,) of a run on the same points.

        Raises:
            KeyError: if the run lacks a channel.
        """
        parts = []
        for block in self.blocks:
            value = np.asarray(raw[block.channel], dtype=np.float64)
            if block.samples is None or block.weights is None:
                parts.append(value.reshape(1))
            else:
                there = np.interp(block.samples, np.asarray(raw[TIME], np.float64), value)
                parts.append(block.weights @ there)
        return np.concatenate(parts)

    def split(self, row: Array) -> dict[str, Array]:
        """The values of a row (..., p) by channel."""
        parts = np.split(row, np.cumsum([b.size for b in self.blocks])[:-1], axis=-1)
        return {b.channel: part for b, part in zip(self.blocks, parts, strict=True)}


def observed(
    recording: Recording, measurement: Measurement, noises: Mapping[str, Noise], end: float
) -> Observed:
    """Put a recording in a row.

    Args:
        recording: with at least one repeat.
        measurement: what is known of clock and channels.
        noises: measurement noise by channel.
        end: [s] of the simulated time.

    Raises:
        ConfigError: if recording and simulation have no time in common.
    """
    blocks, means, covariances, each = [], [], [], []
    for channel in recording.channels:
        series = [r.series[channel] for r in recording.repeats if channel in r.series]
        times = points_in_time(recording, channel, end)
        used = [~s.clipped & (s.times <= end) for s in series]
        samples = [s.times[its] for s, its in zip(series, used, strict=True)]
        operators = [_averaging(at, times) for at in samples]
        there = np.all([np.isfinite(a).all(axis=1) for a in operators], axis=0)
        kept = [a[there] / len(series) for a in operators]
        noise = [noise_of_sums(noises[channel], at, a) for a, at in zip(kept, samples, strict=True)]
        weights = np.hstack(kept)
        values = np.concatenate([s.values[its] for s, its in zip(series, used, strict=True)])
        blocks.append(
            Block(channel, frozen(times[there]), frozen(np.concatenate(samples)), frozen(weights))
        )
        means.append(weights @ values)
        covariances.append(np.sum(noise, axis=0))
        parts = np.split(values, np.cumsum([len(at) for at in samples])[:-1])
        each.append([len(series) * (a @ v) for a, v in zip(kept, parts, strict=True)])
    for name in recording.scalars:
        numbers = [r.scalars[name] for r in recording.repeats if name in r.scalars]
        sd = measurement.of(name).noise or 0.0
        blocks.append(Block(name, None))
        means.append(np.array([np.mean(numbers)]))
        each.append([np.array([number]) for number in numbers])
        covariances.append(np.array([[sd**2 / len(numbers)]]))
    row = np.concatenate(means)
    return Observed(
        name=recording.name,
        blocks=tuple(blocks),
        values=frozen(row),
        repeats=len(recording.repeats),
        measured=frozen(_diagonal(covariances)),
        constant=frozen(_constant(blocks, row, measurement)),
        clock_error=measurement.clock_error,
        start_sd=_start(recording.repeats, end),
        each=_by_repeat(each, len(recording.repeats)),
    )


def _by_repeat(parts: Sequence[Sequence[Array]], repeats: int) -> Array | None:
    """Values (r, p) of every repeat, from those of each channel; None if some lack a channel."""
    if any(len(its) != repeats for its in parts):
        return None
    return frozen([np.concatenate(row) for row in zip(*parts, strict=True)])


def points_in_time(recording: Recording, channel: str, end: float) -> Array:
    """Points [s] at which a series is compared with a simulation until `end` [s].

    Raises:
        ConfigError: if they have no time in common.
    """
    series = [r.series[channel] for r in recording.repeats if channel in r.series]
    first = max(0.0, max(float(s.times[0]) for s in series))
    last = min(end, min(float(s.times[-1]) for s in series))
    if not last > first:
        raise ConfigError(
            f"recording {recording.name!r}: its {channel} lies from {first:g} s to "
            f"{min(float(s.times[-1]) for s in series):g} s, the simulation ends at {end:g} s; "
            "let time 0 be the start of the experiment, or simulate longer"
        )
    return np.linspace(first, last, POINTS)


def _averaging(samples: Array, times: Array) -> Array:
    """Weights (m, n) of samples at each point: a local line; nan where too few are near."""
    width = max(float(times[1] - times[0]), 1.01 * float(np.median(np.diff(samples))))
    weights = np.full((len(times), len(samples)), math.nan)
    for i, t in enumerate(times):
        u = (samples - t) / width
        w = np.maximum(1.0 - np.abs(u), 0.0)
        if np.count_nonzero(w) < FEWEST_SAMPLES:
            continue
        s0, s1, s2 = w.sum(), (w * u).sum(), (w * u * u).sum()
        determinant = s0 * s2 - s1 * s1
        if determinant > 1e-6 * s0 * s0:
            weights[i] = w * (s2 - s1 * u) / determinant
    return weights


def _diagonal(blocks: list[Array]) -> Array:
    total = sum(len(block) for block in blocks)
    matrix, at = np.zeros((total, total)), 0
    for block in blocks:
        matrix[at : at + len(block), at : at + len(block)] = block
        at += len(block)
    return matrix


def _constant(blocks: list[Block], values: Array, measurement: Measurement) -> Array:
    """A column for the zero and one for the scale of each channel."""
    columns, at = [], 0
    for block in blocks:
        known = measurement.of(block.channel)
        here = slice(at, at + block.size)
        for size in (known.offset, known.scale * values[here]):
            column = np.zeros(len(values))
            column[here] = size
            if np.any(column):
                columns.append(column)
        at += block.size
    return np.array(columns).T if columns else np.zeros((len(values), 0))


def _start(repeats: tuple[Repeat, ...], end: float) -> float:
    """Uncertainty of time 0 [s] of the mean of the repeats, the starts independent."""
    each = [min(repeat.start_sd_s, LONGEST_START * end) for repeat in repeats]
    return float(np.sqrt(np.sum(np.square(each)))) / len(each)
