"""Whether repeats of an experiment differ by more than simulation and noise explain.

The fit takes the scatter between repeats from the simulation. One that does not scatter makes their
mean certain, and the intervals too narrow.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.stats import chi2

from calibration.observed import Block, Observed, observed
from calibration.recordings.case import Case
from calibration.recordings.records import Noise, Recording
from mfopt.arrays import Array
from mfopt.names import with_unit
from mfopt.records.rig import Channel
from surrogates.series import SeriesEmulator

CHANCE = 0.001  # of a larger scatter of the repeats, for each channel of each recording


def scatter_not_explained(
    case: Case,
    noises: Mapping[str, Noise],
    channels: Mapping[str, Channel],
    observations: Sequence[Observed],
    emulators: Sequence[SeriesEmulator],
) -> list[str]:
    """Channels of fitted recordings whose repeats differ too much, one sentence each.

    The variance s^2 between n repeats is compared with the expected variance v of one of them, both
    as means over the points: (n - 1) s^2 / v is chi-squared with n - 1 degrees of freedom if all
    points deviate together. Where they do not, chance exceeds the limit more rarely.

    Args:
        case: with the recordings.
        noises: measurement noise by channel.
        channels: of the rig.
        observations: the fitted recordings, in their order.
        emulators: of their conditions.
    """
    lines = []
    for recording, seen, emulator in zip(case.fitted, observations, emulators, strict=True):
        each = [
            observed(replace(recording, repeats=(repeat,)), case.measurement, noises, seen.end)
            for repeat in recording.repeats
        ]
        scatter = seen.split(emulator.scatter())
        for block in seen.blocks:
            found, expected = _variances(block, each, scatter[block.channel])
            freedom = sum(block.channel in its.split(its.values) for its in each) - 1
            if freedom * found > expected * chi2.isf(CHANCE, max(freedom, 1)):
                lines.append(_said(recording, channels[block.channel], found, expected))
    return lines


def _said(recording: Recording, channel: Channel, found: float, expected: float) -> str:
    sd, known = (with_unit(f"{np.sqrt(v):.2g}", channel.unit) for v in (found, expected))
    return (
        f"The repeats of {recording.name} differ in {channel.name} by {sd} (1 sd), and scatter of "
        f"the simulation, noise and stated errors explain {known}: intervals are too narrow. Let "
        "the simulation scatter with its seed as the experiment does, or state what repeats differ "
        f"by in [measurement.{channel.name}]: of a series as offset or scale, of a number as noise"
    )


def _variances(block: Block, each: Sequence[Observed], scatter: Array) -> tuple[float, float]:
    """Variance between repeats, and that expected of one: means over the points of a block.

    Args:
        block: of the mean of the repeats.
        each: the repeats, one by one.
        scatter: standard deviation (m,) of a run at the points of the block.
    """
    rows, variances = zip(*_at(block, each), strict=True)
    if len(rows) < 2:
        return 0.0, 1.0
    between = float(np.mean(np.var(rows, axis=0, ddof=1)))
    return between, float(np.mean(scatter**2) + np.mean(variances))


def _at(block: Block, each: Sequence[Observed]) -> Iterator[tuple[Array, float]]:
    """Values (m,) of each repeat at the points of a block, and the variance of its errors."""
    for its in each:
        values = its.split(its.values).get(block.channel)
        if values is None:
            continue
        variance = np.diag(its.measured) + np.sum(its.constant**2, axis=1)
        own = float(np.mean(its.split(variance)[block.channel]))
        if block.times is None:
            yield values, own
            continue
        times = its.split(its.times)[block.channel]
        clock = its.start_sd**2 + (its.clock_error * times) ** 2
        own += float(np.mean(np.gradient(values, times) ** 2 * clock))
        yield np.interp(block.times, times, values), own
