"""Where simulation and recordings differ, in cells: a recording, a channel, an eighth of its time.

How large: the difference that every hypothesis makes there after the base parameters are refitted
to it, averaged over the hypotheses, in standard deviations of the mean of the repeats. How sure:
the recordings less the best fit, averaged over the cell; how often the largest such mean of all
cells is as large without any mismatch is known from drawn recordings.

Source: Westfall & Young 1993, Resampling-Based Multiple Testing, for the largest of all cells.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calibration.diagnosis.climb import climb
from calibration.diagnosis.compare import Compared
from calibration.diagnosis.joint import LARGEST, NOTHING, SMALLEST, Joint
from calibration.diagnosis.linear import Around
from calibration.diagnosis.weigh import Weighed
from calibration.likelihood import Group
from calibration.observed import Observed
from mfopt.arrays import Array

WINDOWS = 8  # of time
SMALL = 0.01  # probability below which a hypothesis is not looked at
DRAWN = 1000
LEVEL = 0.05  # family-wise


@dataclass(frozen=True, slots=True)
class Cell:
    """One channel of one recording over a window of time."""

    recording: str
    channel: str
    start: float  # [s]; of a number both are 0
    end: float
    low: float  # the range of the recorded values there, in the channel's unit
    high: float
    difference: float  # root mean square, in standard deviations of the mean of the repeats
    excess: float  # mean of simulated with the mismatch less without, in the channel's unit
    probability: float  # that some cell stands out as much without any mismatch

    @property
    def stands_out(self) -> bool:
        """Whether the recordings alone show a mismatch here."""
        return self.probability <= LEVEL


def cells(
    joint: Joint, observations: Sequence[Observed], its: Around, compared: Compared, seed: int
) -> tuple[Cell, ...]:
    """All cells of these recordings."""
    split = np.cumsum([len(g.scores) for g in joint.likelihood.groups])[:-1]
    apart = np.split(difference(joint, compared), split)
    windows = [_windows(seen) for seen in observations]
    chances = np.split(
        _family_wise(joint, its, windows, seed), np.cumsum([len(w) for w in windows])[:-1]
    )
    found = []
    for seen, group, sd, scores, its_windows, chance in zip(
        observations, joint.likelihood.groups, joint.deviations, apart, windows, chances,
        strict=True,
    ):  # fmt: skip
        row = in_points(group, scores)
        for (channel, places), p in zip(its_windows, chance, strict=True):
            times = seen.times[places]
            values = seen.values[places]
            found.append(
                Cell(
                    seen.name, channel, float(times[0]), float(times[-1]),
                    float(values.min()), float(values.max()),
                    float(np.sqrt(np.mean((row[places] / sd[places]) ** 2))),
                    float(row[places].mean()), float(p),
                )
            )  # fmt: skip
    return tuple(found)


def difference(joint: Joint, compared: Compared) -> Array:
    """What is missing in the scores (K,) of the best fit of nothing, over all hypotheses."""
    total = np.zeros(len(joint.scores))
    for weighed, probability in zip(compared.weighed, compared.probabilities, strict=True):
        if weighed.which != NOTHING and probability > SMALL:
            total += probability * _beside(joint, weighed, compared.nothing.best)
    return total


def _beside(joint: Joint, weighed: Weighed, base: Array) -> Array:
    """Scores (K,) of a hypothesis less those of nothing, refitted to them."""
    scores = expected(joint, weighed)
    refitted = climb(joint, NOTHING, scores, base[None]).points
    return np.asarray(scores - joint.means(NOTHING, refitted)[0])


def expected(joint: Joint, weighed: Weighed) -> Array:
    """Noise-free scores (K,) of a hypothesis at its most likely point."""
    point = weighed.best[None]
    mean = joint.means(weighed.which, point)[0]
    if weighed.which.other:
        strength = weighed.which.strengths(point[:, -weighed.which.added :])[0, -1]
        own = (SMALLEST * (LARGEST / SMALLEST) ** strength) ** 2 * joint.unknown()
        covariance = joint.covariances(weighed.which, point)[0]
        mean = mean + own @ np.linalg.solve(covariance, joint.scores - mean)
    return np.asarray(mean)


def in_points(group: Group, scores: Array) -> Array:
    """Series (..., p) that scores (..., q) of a recording add, in the channels' units."""
    return np.asarray(scores @ group.basis * group.emulator.scale)


def _windows(seen: Observed) -> list[tuple[str, slice]]:
    """Channel and places in the row of each window of time."""
    found, at = [], 0
    for block in seen.blocks:
        edges = at + np.linspace(0, block.size, min(WINDOWS, block.size) + 1).round().astype(int)
        found += [(block.channel, slice(a, b)) for a, b in itertools.pairwise(edges)]
        at += block.size
    return found


def _family_wise(
    joint: Joint, its: Around, windows: Sequence[Sequence[tuple[str, slice]]], seed: int
) -> Array:
    """For each window the probability of a largest mean residual as large, of all windows."""
    rng = np.random.default_rng(seed)
    noise = rng.standard_normal((DRAWN, len(joint.scores))) @ its.factor.T
    left = its.residuals(np.vstack([joint.scores - its.mean, noise]))
    split = np.cumsum([len(g.scores) for g in joint.likelihood.groups])[:-1]
    means = []
    for group, scores, own in zip(
        joint.likelihood.groups, np.split(left, split, axis=1), windows, strict=True
    ):
        rows = in_points(group, scores)
        means += [rows[:, places].mean(axis=1) for _, places in own]
    every = np.abs(np.array(means).T)
    every = every / every[1:].std(axis=0)
    largest = np.sort(every[1:].max(axis=1))
    above = DRAWN - np.searchsorted(largest, every[0], side="left")
    return np.asarray((1.0 + above) / (1.0 + DRAWN))
