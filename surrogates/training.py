"""Training rows of one process: replicates merged, inputs and outputs standardised."""

from dataclasses import dataclass

import numpy as np

from mfopt.arrays import Array, BoolArray, IntArray
from surrogates.warp import Warp

FAILURE_MARGIN = 0.5  # failed runs lie so many standard deviations above the worst finished one
FEWEST_FOR_SCALE = 4  # a level with fewer points takes the scale of the level below it
SMALLEST_SCALE = 1e-9  # relative; constant values get this spread


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Distinct points (n, d), sorted by level; `group` leads from finished runs to them.

    A point with finished and failed runs has a row for each kind.
    """

    levels: tuple[int, ...]  # that have rows, ascending
    z: Array  # (n, d)
    index: IntArray  # (n,) position of the row's level in `levels`
    failed: BoolArray  # (n,)
    replicates: IntArray  # (n,)
    group: IntArray  # (finished runs,) row of each
    value: Array  # (finished runs,)

    @property
    def starts(self) -> IntArray:
        """First row of each level."""
        return np.searchsorted(self.index, np.arange(len(self.levels)))


@dataclass(frozen=True, slots=True, eq=False)
class Scaling:
    """Standardisation: x = (z - z_mean) / z_scale, y = (T(f) - centre) / scale by level."""

    z_mean: Array  # (d,)
    z_scale: Array  # (d,)
    centre: Array  # (levels,)
    scale: Array  # (levels,)

    def inputs(self, z: Array) -> Array:
        """Standardised inputs."""
        return (z - self.z_mean) / self.z_scale


def rows_of(z: Array, level: IntArray, value: Array) -> Rows:
    """Merge replicates: rows with the same z, level and kind of end (finished or failed)."""
    failed = ~np.isfinite(value)
    keys = np.column_stack([level, failed, z])
    distinct, inverse, replicates = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    levels, index = np.unique(distinct[:, 0].astype(np.int64), return_inverse=True)
    return Rows(
        levels=tuple(int(k) for k in levels),
        z=distinct[:, 2:],
        index=index.astype(np.int64),
        failed=distinct[:, 1] > 0.0,
        replicates=replicates.astype(np.int64),
        group=inverse.reshape(-1)[~failed].astype(np.int64),
        value=value[~failed],
    )


def subset(rows: Rows, keep: IntArray) -> Rows:
    """The rows `keep` (ascending) with their finished runs; all levels must remain."""
    position = np.full(len(rows.z), -1)
    position[keep] = np.arange(len(keep))
    group = position[rows.group]
    return Rows(
        levels=rows.levels,
        z=rows.z[keep],
        index=rows.index[keep],
        failed=rows.failed[keep],
        replicates=rows.replicates[keep],
        group=group[group >= 0],
        value=rows.value[group >= 0],
    )


def spread_rows(rows: Rows, limit: int) -> IntArray:
    """Rows (ascending), at most `limit`: small levels whole, large ones thinned.

    Levels share the limit, what a small level leaves goes to the larger ones; within a level the
    rows are spread evenly over the order of their values, failed ones last.
    """
    means, left, chosen = group_means(rows, rows.value), limit, []  # nan sorts last
    own = [np.flatnonzero(rows.index == k) for k in range(len(rows.levels))]
    own.sort(key=len)
    for k, candidates in enumerate(own):
        share = min(len(candidates), left // (len(own) - k))
        order = candidates[np.argsort(means[candidates], kind="stable")]
        chosen.append(order[np.linspace(0, len(order) - 1, share).round().astype(np.int64)])
        left -= share
    return np.sort(np.concatenate(chosen))


def group_means(rows: Rows, values: Array) -> Array:
    """Mean over the finished runs of each row (n,); nan for failed rows."""
    total = np.bincount(rows.group, values, minlength=len(rows.z))
    return np.where(rows.failed, np.nan, total / rows.replicates)


def scaling_of(rows: Rows, warp: Warp) -> Scaling:
    """Standardise inputs over all rows, outputs by level over its finished rows."""
    z_scale = rows.z.std(axis=0)
    z_scale[z_scale <= 1e-12 * (1.0 + np.abs(rows.z).max(axis=0))] = 1.0
    y = group_means(rows, warp.forward(rows.value))
    finished = y[~rows.failed]
    smallest = SMALLEST_SCALE * max(1.0, float(np.abs(finished).max()))
    last = max(float(finished.std()) or float(warp.forward(rows.value).std()), smallest)
    centre = np.full(len(rows.levels), finished.mean())
    scale = np.empty(len(rows.levels))
    for k in range(len(rows.levels)):
        own = y[(rows.index == k) & ~rows.failed]
        if len(own):
            centre[k] = own.mean()
        if len(own) >= FEWEST_FOR_SCALE and own.std() > smallest:
            last = float(own.std())
        scale[k] = last
    return Scaling(rows.z.mean(axis=0), z_scale, centre, scale)


def outputs(rows: Rows, warp: Warp, scaling: Scaling) -> Array:
    """Standardised outputs (n,); failed rows take the worst of their level plus a margin."""
    means = group_means(rows, warp.forward(rows.value))
    y = (means - scaling.centre[rows.index]) / scaling.scale[rows.index]
    for k in range(len(rows.levels)):
        own = rows.index == k
        finished = y[own & ~rows.failed]
        y[own & rows.failed] = (finished.max() if len(finished) else 1.0) + FAILURE_MARGIN
    return y
