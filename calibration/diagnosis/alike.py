"""Effects that these recordings cannot tell apart, whatever they show.

Each effect is taken at the strength at which it would just be found. What is left of its influence
after the base parameters are refitted is compared with what another effect leaves, at the strength
at which both are most alike. If the other explains it that well, in both directions, they are of
one class.
"""

from collections.abc import Sequence

import numpy as np

from calibration.diagnosis.linear import Around
from mfopt.arrays import AnyArray, Array

CLEAR = 25.0  # squared distance from nothing at which an effect is found
CLOSE = 6.0  # squared distance below which two are alike: a log evidence of 3
MOST = 3  # effects in a class


def alike(its: Around) -> tuple[tuple[str, ...], ...]:
    """Classes of two or three effects that cannot be told apart."""
    rows = [its.seen(shifts) for shifts in its.shifts]
    names = [which.name for which in its.single]
    near = np.array([[_distance(a, b) for b in rows] for a in rows])
    both = (near < CLOSE) & (near.T < CLOSE)
    classes: list[tuple[int, ...]] = []
    for i, j in sorted(zip(*np.nonzero(np.triu(both, 1)), strict=True), key=lambda ij: near[ij]):
        if not any({i, j} <= set(c) for c in classes):
            classes.append(_grown((int(i), int(j)), both))
    return tuple(tuple(names[k] for k in its_class) for its_class in classes)


def faint(its: Around) -> tuple[str, ...]:
    """Effects that these recordings cannot show even at full strength."""
    rows = (its.seen(shifts) for shifts in its.shifts)
    return tuple(
        which.name
        for which, row in zip(its.single, rows, strict=True)
        if float(np.sum(row**2, axis=1).max()) < CLEAR
    )


def _grown(members: tuple[int, ...], both: AnyArray) -> tuple[int, ...]:
    """A class with one more member, if there is one like all of them."""
    for k in range(len(both)):
        if len(members) < MOST and k not in members and all(both[k, m] for m in members):
            members = (*members, k)
    return members


def _distance(rows: Array, others: Array) -> float:
    """Squared distance of an effect that is just clear from the nearest of another effect.

    Args:
        rows: what is seen of the effect at its strengths (m, K).
        others: of the other effect (n, K); between its strengths it is linear.

    Returns:
        The smaller one of both signs; infinite if the effect is never clear.
    """
    sizes = np.sum(rows**2, axis=1)
    middle = int(np.argmin(sizes))  # where it is absent
    found = []
    for half in (rows[middle:], rows[middle::-1]):
        clear = np.flatnonzero(np.sum(half**2, axis=1) >= CLEAR)
        if len(clear):
            found.append(_to_line(half[clear[0]], others))
    return min(found, default=np.inf)


def _to_line(point: Array, line: Sequence[Array] | Array) -> float:
    """Squared distance of a point (K,) from straight pieces between points (n, K)."""
    start, way = np.asarray(line)[:-1], np.diff(line, axis=0)
    length = np.sum(way**2, axis=1)
    part = np.sum((point - start) * way, axis=1) / np.where(length > 0.0, length, 1.0)
    nearest = start + np.clip(part, 0.0, 1.0)[:, None] * way
    return float(np.sum((point - nearest) ** 2, axis=1).min())
