"""Whether repeats of an experiment agree; a later start is no contradiction."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize_scalar

from calibration.recordings.case import Known
from calibration.recordings.records import Repeat, Series
from mfopt.arrays import Array
from mfopt.errors import ConfigError
from mfopt.records.rig import Channel

NOISE_FACTOR = 5.0  # a difference within so many sd of its own noise is none
OFFSET_FACTOR = 3.0 * math.sqrt(2.0)  # two zeros, 3 sd each
SAID = 0.5  # share of the tolerance above which a difference is said
SCALAR_FACTOR = 3.0  # numbers may differ by so many times the tolerance of series
GRID = 200  # times at which series are compared
SHIFTS = 41  # tried between minus and plus half of the shorter series
SMALLEST_SCALE = 0.01  # of the channel's size; smaller ranges are no signal
NOTHING_KNOWN = Known()


def agreeing(
    repeats: Sequence[Repeat],
    channel: Channel,
    tolerance: float,
    where: str,
    known: Known = NOTHING_KNOWN,
) -> tuple[Repeat, ...]:
    """The repeats, with a note where one starts later than the first, or is unlike the others.

    A repeat contradicts the others if, at the best shift in time, the rms difference between its
    series and the median of the others exceeds `tolerance` times the range of the series, what a
    stated error of the zero explains, and five times the noise, stated or of the series.

    Args:
        repeats: runs under the same conditions.
        channel: that is compared.
        tolerance: share of the range.
        where: case file and recording, for messages.
        known: what is stated of the channel.

    Raises:
        ConfigError: if one contradicts the others, or is a copy.
    """
    having = [i for i, repeat in enumerate(repeats) if channel.name in repeat.series]
    series = [repeats[i].series[channel.name] for i in having]
    files = [repeats[i].file for i in having]
    _check_copies(series, files, where)
    checked = list(repeats)
    if len(series) < 2:
        return tuple(checked)
    free = [math.isinf(repeats[i].start_sd_s) for i in having]
    pairs = zip(series[1:], free[1:], strict=True)
    shifts = [0.0, *(best_shift(series[0], s, free=free[0] or its) for s, its in pairs)]
    k, far, noise, scale = _farthest(series, shifts, channel)
    noise = max(noise, known.noise or 0.0)
    explained = max(NOISE_FACTOR * noise, OFFSET_FACTOR * known.offset)
    if far > max(tolerance * scale, explained):
        others = ", ".join(file for i, file in enumerate(files) if i != k)
        raise ConfigError(
            f"{where}: {channel.name} of {files[k]} differs from {others} by {far:.3g} "
            f"{channel.unit} rms, {far / scale:.0%} of the range, above the limit of "
            f"{tolerance:.0%}; these are no repeats: leave one out, make it a recording of its "
            "own, or raise repeat_tolerance in [measurement]"
        )
    if far > max(SAID * tolerance * scale, explained):
        _add_note(checked, having[k], f"{channel.name} differs by {far / scale:.0%} of the range "
                  "from the other repeats.")  # fmt: skip
    for i, shift, its in zip(having, shifts, series, strict=True):
        step = float(np.median(np.diff(its.times)))
        if abs(shift) > 3.0 * max(checked[i].start_sd_s, step):
            early = "later" if shift > 0.0 else "earlier"
            said = f"{channel.name} starts {abs(shift):.3g} s {early} than in {files[0]}."
            _add_note(checked, i, said)
    return tuple(checked)


def _add_note(repeats: list[Repeat], i: int, note: str) -> None:
    repeats[i] = replace(repeats[i], notes=(*repeats[i].notes, note))


def check_scalars(
    repeats: Sequence[Repeat],
    channel: Channel,
    tolerance: float,
    where: str,
    known: Known = NOTHING_KNOWN,
) -> None:
    """Refuse a number that is far from the median of the other repeats.

    Raises:
        ConfigError: if it differs by more than three times `tolerance`, relative to that median or,
            of a number that can vanish, to the usual size; and by more than five times the noise
            that is stated.
    """
    values = [r.scalars[channel.name] for r in repeats if channel.name in r.scalars]
    limit = SCALAR_FACTOR * tolerance
    for i, value in enumerate(values):
        rest = [*values[:i], *values[i + 1 :]]
        middle = float(np.median(rest)) if rest else value
        least = channel.size if channel.can_vanish else SMALLEST_SCALE * channel.size
        scale = max(abs(middle), least)
        # With two numbers each is as far from the other; both are named.
        most = max(limit * scale, NOISE_FACTOR * (known.noise or 0.0))
        if abs(value - middle) > most and (len(values) < 4 or _is_outlier(value, rest)):
            raise ConfigError(
                f"{where}: {channel.name} = {value:.4g} {channel.unit} differs from the other "
                f"repeats ({', '.join(f'{v:.4g}' for v in rest[:5])}) by "
                f"{abs(value - middle) / scale:.0%}, above the limit of {limit:.0%}; correct or "
                "leave out one, or raise repeat_tolerance in [measurement]"
            )


def best_shift(reference: Series, other: Series, *, free: bool = False) -> float:
    """By how much later the other series runs [s]: the shift with the least rms difference.

    At most half of the shorter duration, so that at least half of it is compared. Returns 0 where
    a shift does not halve the rms difference: that may be scatter. A `free` start, of which nothing
    is known, is shifted all the same.
    """
    most = 0.5 * min(np.ptp(reference.times), np.ptp(other.times))

    def rms(shift: float) -> float:
        return _rms(reference, other, shift)

    tried = np.linspace(-most, most, SHIFTS)
    losses = [rms(shift) for shift in tried]
    best = tried[int(np.argmin(losses))]
    step = tried[1] - tried[0]
    found = minimize_scalar(rms, bounds=(best - step, best + step), method="bounded")
    return float(found.x) if free or found.fun < 0.5 * rms(0.0) else 0.0


def roughness(series: Series) -> float:
    """Noise of a series from sample to sample, 1 sd: the median of its second differences.

    The middle value of three is compared with the line through the others. Smooth changes cancel.
    """
    times, values = series.times, series.values
    if times.size < 3:
        return 0.0
    share = (times[1:-1] - times[:-2]) / (times[2:] - times[:-2])
    bend = values[1:-1] - (1.0 - share) * values[:-2] - share * values[2:]
    spread = np.sqrt(1.0 + share**2 + (1.0 - share) ** 2)
    return float(np.median(np.abs(bend) / spread) / 0.6745)  # median of |normal| is 0.6745 sd


def _check_copies(series: Sequence[Series], files: Sequence[str], where: str) -> None:
    for i, one in enumerate(series):
        for j in range(i):
            same = np.array_equal(one.values, series[j].values)
            if same and np.array_equal(one.times, series[j].times) and np.ptp(one.values) > 0.0:
                raise ConfigError(
                    f"{where}: {files[i]} and {files[j]} hold the same {one.times.size} values of "
                    f"{one.channel}; a copy is no repeat: leave out one"
                )


def _farthest(
    series: Sequence[Series], shifts: Sequence[float], channel: Channel
) -> tuple[int, float, float, float]:
    """Which series is farthest from the others, by how much (rms), noise, and range of all."""
    scale = max(max(float(np.ptp(s.values)) for s in series), SMALLEST_SCALE * channel.size)
    begin = min(float(s.times[0]) - shift for s, shift in zip(series, shifts, strict=True))
    end = max(float(s.times[-1]) - shift for s, shift in zip(series, shifts, strict=True))
    grid = np.linspace(begin, end, GRID)
    rows = np.array([_at(s, grid + shift) for s, shift in zip(series, shifts, strict=True)])
    far = [_rms_from_others(rows, i) for i in range(len(series))]
    k = int(np.argmax(far))
    noise = max(roughness(s) for s in series)
    return k, far[k], noise, scale


def _rms_from_others(rows: Array, i: int) -> float:
    others = np.delete(rows, i, axis=0)
    there = np.isfinite(rows[i]) & np.any(np.isfinite(others), axis=0)
    if np.sum(there) < 2:
        return 0.0
    middle = np.nanmedian(others[:, there], axis=0)
    return float(np.sqrt(np.mean((rows[i, there] - middle) ** 2)))


def _rms(reference: Series, other: Series, shift: float) -> float:
    begin = max(reference.times[0], other.times[0] - shift)
    end = min(reference.times[-1], other.times[-1] - shift)
    if begin >= end:
        return float("inf")
    grid = np.linspace(begin, end, GRID)
    difference = np.interp(grid, reference.times, reference.values) - np.interp(
        grid + shift, other.times, other.values
    )
    return float(np.sqrt(np.mean(difference**2)))


def _at(series: Series, times: Array) -> Array:
    """Values at `times` (n,), nan beyond the ends."""
    return np.interp(times, series.times, series.values, left=np.nan, right=np.nan)


def _is_outlier(value: float, rest: Sequence[float]) -> bool:
    """Whether it is farther from the middle of the others than each of them."""
    middle = np.median(rest)
    return bool(abs(value - middle) > np.max(np.abs(np.asarray(rest) - middle)))
