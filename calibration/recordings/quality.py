"""What a series says of its sensor: step between values, limits, gaps in time."""

import math

import numpy as np

from mfopt.arrays import Array, BoolArray

MOST_DECIMALS = 9  # more are no choice of a sensor
SHORTEST_CLIP = 4  # samples; a peak shows up to 3 equal ones
FEWEST_STEPS = 8  # different steps that make a grid plausible
SLIP = (300.0, 3000.0)  # a value so far off its neighbours has another unit or a lost decimal sign


def quantum_of(values: Array) -> float:
    """The step between neighbouring values (n,), in their unit; 0 if none is found.

    All values are multiples of it, apart from a common offset. It is found from the decimals that
    were written, or from the smallest difference if all others are multiples of that.
    """
    levels = np.unique(values)
    if levels.size < 2:
        return 0.0
    return max(_decimal_step(levels), _common_step(levels))


def _decimal_step(levels: Array) -> float:
    """The largest common divisor of values written with few decimals."""
    for decimals in range(MOST_DECIMALS + 1):
        scaled = levels * 10.0**decimals
        whole = np.rint(scaled)
        if np.max(np.abs(whole)) > 2.0**53:
            return 0.0
        if np.all(np.abs(scaled - whole) <= 1e-6):
            steps = np.diff(whole.astype(np.int64))
            return float(np.gcd.reduce(steps)) / 10.0**decimals
    return 0.0


def _common_step(levels: Array) -> float:
    """The smallest difference, if all others are multiples of it within a tenth."""
    steps = np.diff(levels)
    fine = steps > 1e-9 * (levels[-1] - levels[0])
    steps = steps[fine]
    if steps.size < FEWEST_STEPS:
        return 0.0
    step = float(np.median(steps[steps < 1.5 * np.min(steps)]))
    multiples = np.rint(steps / step)
    step = float(np.sum(steps * multiples) / np.sum(multiples**2))
    off = np.abs(steps / step - np.rint(steps / step))
    return step if np.max(off) <= 0.1 else 0.0


def clipped_at(values: Array, quantum: float, unit: str) -> BoolArray:
    """Which values (n,) lie at a limit of the sensor that shows in the series itself.

    A sensor at its limit gives one value, the largest or the smallest of the series, at least four
    times in a row, and the series runs into that value at speed. A quantity that comes to rest
    slows down before. Zero, and one for a share, are limits of the quantity, not of the sensor.
    """
    clipped = np.zeros(values.size, dtype=np.bool_)
    natural = (0.0, 1.0) if unit == "-" else (0.0,)
    for extreme in (np.max(values), np.min(values)):
        at = values == extreme
        if np.all(at) or any(math.isclose(extreme, end, abs_tol=1e-12) for end in natural):
            continue
        runs = _runs(at)
        if any(_at_speed(values, run, quantum) for run in runs):
            clipped |= at
    return clipped


def _runs(at: BoolArray) -> list[tuple[int, int]]:
    """First index and end of each run of SHORTEST_CLIP or more."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], at.astype(np.int8), [0]])))
    return [(a, b) for a, b in edges.reshape(-1, 2).tolist() if b - a >= SHORTEST_CLIP]


def _at_speed(values: Array, run: tuple[int, int], quantum: float) -> bool:
    """Whether the series enters or leaves a run at 0.3 of its mean speed or more.

    Speeds are measured over as many samples as the run has, at most 4 % of the series. Steps of a
    coarse sensor around a peak stay below 6 quanta there.
    """
    begin, end = run
    width = min(max(3, end - begin), max(3, values.size // 25))
    usual = _mean_speed(values, width, moving=values.size - (end - begin))
    for near in (values[max(0, begin - width) : begin], values[end : end + width]):
        if near.size < 3:
            continue
        far = abs(float(np.mean(near)) - float(values[begin]))
        if far > 6.0 * quantum and far / (0.5 * (near.size + 1)) > 0.3 * usual:
            return True
    return False


def _mean_speed(values: Array, width: int, moving: int) -> float:
    """Mean change per sample of means over `width` samples, while the series moves."""
    blocks = values[: values.size // width * width].reshape(-1, width).mean(axis=1)
    return float(np.sum(np.abs(np.diff(blocks)))) / moving


def gaps_in(times: Array) -> tuple[int, float, float]:
    """Number of gaps in regular times (n,), the longest one and its begin [s]; 0 if irregular.

    Times are regular if most steps are within 20 % of the median step. A gap exceeds 1.5 of it.
    """
    steps = np.diff(times)
    usual = float(np.median(steps))
    if np.mean(np.abs(steps / usual - 1.0) < 0.2) < 0.6:
        return 0, 0.0, 0.0
    gaps = np.flatnonzero(steps > 1.5 * usual)
    if gaps.size == 0:
        return 0, 0.0, 0.0
    longest = gaps[np.argmax(steps[gaps])]
    return int(gaps.size), float(steps[longest]), float(times[longest])


def is_regular(times: Array) -> bool:
    """Whether all steps between times (n,) are multiples of the median step, within 20 % of it."""
    steps = np.diff(times) / np.median(np.diff(times))
    return bool(np.all(np.abs(steps - np.maximum(np.rint(steps), 1.0)) < 0.2))


def slipped(values: Array) -> int | None:
    """Index of a value about 1 000 times its neighbours, or a thousandth of them; None if none.

    The two neighbours on each side must agree within a factor of 2, and the value must be ten usual
    changes away, so that noise around 0 does not count.
    """
    if values.size < 5:
        return None
    nearby = np.stack([values[:-4], values[1:-3], values[3:-1], values[4:]])
    around = np.abs(nearby)
    low, high = np.min(around, axis=0), np.max(around, axis=0)
    here = np.abs(values[2:-2])
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        ratio = np.where(here > high, here / high, low / here)
    jump = np.abs(values[2:-2] - np.mean(nearby, axis=0))
    far = jump > 10.0 * np.median(np.abs(np.diff(values)))
    off = far & (low > 0.0) & (high <= 2.0 * low) & (ratio >= SLIP[0]) & (ratio <= SLIP[1])
    return int(np.argmax(off)) + 2 if np.any(off) else None
