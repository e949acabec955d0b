"""Effects of measuring: how an error of camera or sensor changes what a simulation gives.

Each acts on the simulated series y(t) of every recording alike. Its size is v = full s |s| at the
strength s; T is the end of the recording:

    clock_rate       y(t (1 + v))             the clock of the camera is slow by v
    clock_offset     y(t + v T)               time 0 lies too late
    length_scale     y (1 + v)                of channels that are lengths
    sensor_bias      y + v range(mean)        of one channel
    smoothing        y averaged over time with the standard deviation v T
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d

from calibration.observed import Block, Observed
from mfopt.arrays import Array, frozen
from surrogates.series import SeriesEmulator

FULL = 0.1  # of clock, length and sensor, at full strength
WIDEST = 0.05  # of smoothing
NODES = 17  # strengths from -1 to 1 at which a change is computed; half as many from 0


@dataclass(frozen=True, slots=True)
class MeasuringEffect:
    """An effect of measuring."""

    name: str
    signed: bool  # strengths from -1 to 1, else from 0
    full: float  # its size at full strength
    unit: str
    meaning: str
    channel: str | None = None  # of the only channel that it changes

    def size(self, strength: float) -> float:
        """Size [unit] at a strength."""
        return self.full * strength * abs(strength)

    @property
    def strengths(self) -> Array:
        """Even strengths (m,) over all that are tried."""
        return np.linspace(-1.0, 1.0, NODES) if self.signed else np.linspace(0.0, 1.0, NODES // 2)


def measuring_effects(channels: Sequence[str], lengths: bool) -> tuple[MeasuringEffect, ...]:
    """All of them, for recordings with these channels; `lengths`: whether some are lengths."""
    scale = MeasuringEffect(
        "length_scale",
        True,
        FULL,
        "-",
        "share by which lengths are recorded too long (negative: too short)",
    )
    return (
        MeasuringEffect(
            "clock_rate", True, FULL, "-", "share by which the clock is slow (negative: fast)"
        ),
        MeasuringEffect(
            "clock_offset", True, FULL, "of the duration",
            "time by which the recorded zero is late (negative: early)",
        ),
        *([scale] if lengths else []),
        *(
            MeasuringEffect(
                f"sensor_bias.{channel}", True, FULL, "of the range",
                f"by how much {channel} is recorded too high (negative: too low)", channel,
            )
            for channel in channels
        ),
        MeasuringEffect(
            "smoothing", False, WIDEST, "of the duration",
            "standard deviation over which series are averaged in time",
        ),
    )  # fmt: skip


def shape(
    its: MeasuringEffect,
    seen: Observed,
    emulator: SeriesEmulator,
    basis: Array,
    lengths: Mapping[str, bool],
) -> Array:
    """What the effect adds to the scores of a recording.

    Args:
        its: the effect.
        seen: the recording.
        emulator: of its conditions.
        basis: of the scores (q, p).
        lengths: whether a channel is a length.

    Returns:
        For each of its strengths a matrix (m, q, k + 1) that takes simulated scores (k,) and 1.
    """
    rows = np.vstack([emulator.components * emulator.scale, emulator.mean])
    made = []
    for strength in its.strengths:
        changed, at = np.zeros_like(rows), 0
        for block in seen.blocks:
            here = slice(at, at + block.size)
            acts = its.name != "length_scale" or lengths[block.channel]
            if acts and its.channel in (None, block.channel):
                size = its.size(float(strength))
                changed[:, here] = _changed(its, size, block, rows[:, here], seen.end)
            at += block.size
        made.append((changed / emulator.scale @ basis.T).T)
    return frozen(made)


def _changed(its: MeasuringEffect, size: float, block: Block, rows: Array, end: float) -> Array:
    """What is added to the rows (k + 1, m) of one channel, of which the last is the mean."""
    kind = its.name.partition(".")[0]
    if kind == "length_scale":
        return rows * size
    if kind == "sensor_bias":
        added = np.zeros_like(rows)
        added[-1] = size * (np.ptp(rows[-1]) or abs(rows[-1, 0]))
        return added
    times = block.times
    if times is None:
        return np.zeros_like(rows)
    if kind == "clock_rate":
        return _at(times * (1.0 + size), times, rows) - rows
    if kind == "clock_offset":
        return _at(times + size * end, times, rows) - rows
    return _smoothed(rows, size * end / float(np.median(np.diff(times)))) - rows


def _smoothed(rows: Array, width: float) -> Array:
    """Rows (k, m) averaged over so many points (1 sd); at the ends they go straight on."""
    if width == 0.0:
        return rows
    beyond = rows.shape[1] - 1
    longer = np.pad(rows, ((0, 0), (beyond, beyond)), mode="reflect", reflect_type="odd")
    return np.asarray(gaussian_filter1d(longer, width, axis=1)[:, beyond:-beyond])


def _at(wanted: Array, times: Array, rows: Array) -> Array:
    """Rows (k, m) at other times (m,), beyond the ends straight on."""
    spline = CubicSpline(times, rows, axis=1)
    inside = np.clip(wanted, times[0], times[-1])
    return np.asarray(spline(inside) + spline(inside, 1) * (wanted - inside))
