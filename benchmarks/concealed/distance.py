"""How far a missing effect moves recordings beyond what the base parameters can explain."""

from collections.abc import Sequence

import numpy as np

from calibration.diagnosis.climb import climb
from calibration.diagnosis.joint import NOTHING, Hypothesis, Joint
from calibration.diagnosis.where import in_points
from mfopt.arrays import Array


def rows_of(joint: Joint, which: Hypothesis, point: Array) -> list[Array]:
    """Noise-free rows (p,) of all recordings at a point (D,) of a hypothesis."""
    return [rows[0] for rows in rows_at(joint, which, point[None])]


def rows_at(joint: Joint, which: Hypothesis, points: Array) -> list[Array]:
    """Noise-free rows (n, p) of all recordings at points (n, D) of a hypothesis."""
    groups = joint.likelihood.groups
    split = np.cumsum([len(g.scores) for g in groups])[:-1]
    parts = np.split(joint.means(which, points), split, axis=1)
    return [g.emulator.mean + in_points(g, part) for g, part in zip(groups, parts, strict=True)]


def differences(joint: Joint, rows: Sequence[Array], dimensions: int) -> list[Array]:
    """Noise-free rows (p,) less the best refit of so many base parameters.

    In standard deviations of the mean of the repeats.
    """
    groups = joint.likelihood.groups
    scores = np.concatenate(
        [
            (row - g.emulator.mean) / g.emulator.scale @ g.basis.T
            for row, g in zip(rows, groups, strict=True)
        ]
    )
    refitted = climb(joint, NOTHING, scores, np.full((1, dimensions), 0.5)).points
    fitted = rows_of(joint, NOTHING, refitted[0])
    return [(row - fit) / sd for row, fit, sd in zip(rows, fitted, joint.deviations, strict=True)]


def distance(joint: Joint, rows: Sequence[Array], dimensions: int) -> float:
    """Distance D of noise-free rows (p,)."""
    return furthest(differences(joint, rows, dimensions))


def furthest(apart: Sequence[Array]) -> float:
    """The largest of the differences: D."""
    return max(float(np.max(np.abs(d))) for d in apart)
