"""Recordings of a concealed case: runs as a camera and a scale see them.

Samples have noise that is correlated in time, and are rounded to what the instruments resolve. Each
recording has its own error of the ruler's zero and of the clock, of the sizes that a case states.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter1d

from benchmarks.calibration.experiments import correlated_noise
from benchmarks.concealed.rigs import CHANNELS, CLOCK, SETTINGS, ZERO, file_of
from calibration.diagnosis.measuring import MeasuringEffect, measuring_effects
from mfopt.arrays import Array
from mfopt.records.rig import TIME

RATE = 60.0  # [1/s] pictures
NOISE = {"discharged_fraction": 4e-3, "level_left": 4e-4, "level_right": 4e-4}  # 1 sd
STEPS = {"discharged_fraction": 2e-3, "level_left": 2e-4, "level_right": 2e-4}  # of values
DECIMALS = {"discharged_fraction": 3, "level_left": 4, "level_right": 4}
LENGTHS = ("level_left", "level_right")
UNITS = {"discharged_fraction": "-", "level_left": "m", "level_right": "m"}

Raw = Mapping[str, Any]  # time [s] and channels of a run


def recorded(
    runs: Mapping[str, Sequence[Raw]], measured: Mapping[str, float], seed: int
) -> dict[str, str]:
    """The files of a case, by name.

    Args:
        runs: of each recording, by its name: one for each repeat.
        measured: strengths of effects of measuring, by name.
        seed: of the noise.
    """
    effects = {its.name: its for its in measuring_effects(CHANNELS, True)}
    sizes = [(effects[name], effects[name].size(s)) for name, s in measured.items()]
    files = {}
    for place, setting in enumerate(SETTINGS):
        rng = np.random.default_rng([seed, place])
        clock = rng.normal(0.0, CLOCK)
        zeros = {channel: rng.normal(0.0, ZERO) for channel in LENGTHS}
        for repeat, raw in enumerate(runs[setting.name]):
            times = np.arange(0.0, raw[TIME][-1] / (1.0 + clock) - 1e-9, 1.0 / RATE)
            seen = _as_measured(times * (1.0 + clock), raw, sizes)
            for channel in CHANNELS:
                noisy = seen[channel] + zeros.get(channel, 0.0)
                noisy = noisy + correlated_noise(rng, len(times), NOISE[channel])
                seen[channel] = np.round(noisy / STEPS[channel]) * STEPS[channel]
            files[file_of(setting, repeat)] = _text(times, seen)
    return files


def _as_measured(
    times: Array, raw: Raw, sizes: Sequence[tuple[MeasuringEffect, float]]
) -> dict[str, Array]:
    """Channels at these times, as instruments with errors of such sizes show them."""
    end = float(raw[TIME][-1])
    fine = np.asarray(raw[TIME], dtype=float)
    made = {}
    for channel in CHANNELS:
        at, values = times, np.asarray(raw[channel], dtype=float)
        for its, size in sizes:
            kind = its.name.partition(".")[0]
            if kind == "clock_rate":
                at = at * (1.0 + size)
            elif kind == "clock_offset":
                at = at + size * end
            elif kind == "smoothing":
                values = _smoothed(fine, values, size * end)
        series = np.interp(at, fine, values)
        for its, size in sizes:
            if its.name == "length_scale" and channel in LENGTHS:
                series = series * (1.0 + size)
            elif its.channel == channel:
                series = series + size * float(np.ptp(values))
        made[channel] = series
    return made


def _smoothed(times: Array, values: Array, width: float) -> Array:
    """Values averaged over time with the standard deviation `width` [s]; they end straight on."""
    even = np.linspace(0.0, times[-1], len(times))
    beyond = len(even) - 1
    longer = np.pad(np.interp(even, times, values), beyond, mode="reflect", reflect_type="odd")
    smooth = gaussian_filter1d(longer, width / even[1])[beyond:-beyond]
    return np.asarray(np.interp(times, even, smooth))


def _text(times: Array, seen: Mapping[str, Array]) -> str:
    head = ",".join(["time [s]", *(f"{c} [{UNITS[c]}]" for c in CHANNELS)])
    rows = [
        ",".join([f"{t:.4f}", *(f"{seen[c][i]:.{DECIMALS[c]}f}" for c in CHANNELS)])
        for i, t in enumerate(times)
    ]
    return "\n".join([head, *rows]) + "\n"
