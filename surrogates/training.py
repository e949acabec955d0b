"""Training rows of one process: replicates merged, inputs and outputs standardised."""

from dataclasses import dataclass

import numpy as np

from mfopt.arrays import Array, IntArray
from surrogates.warp import SMALLEST_WARP, Warp

SMALLEST_SCALE = 1e-9  # relative; constant values get this spread


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Distinct points (n, d), sorted by level; `group` is the row of each run."""

    levels: tuple[int, ...]  # that have rows, ascending
    z: Array  # (n, d)
    index: IntArray  # (n,) position of the row's level in `levels`
    replicates: IntArray  # (n,)
    group: IntArray  # (runs,) row of each
    value: Array  # (runs,)

    @property
    def starts(self) -> IntArray:
        """First row of each level."""
        return np.searchsorted(self.index, np.arange(len(self.levels)))


@dataclass(frozen=True, slots=True, eq=False)
class Scaling:
    """Standardisation: x = (z - z_mean) / z_scale, y = (T(f) - centre of the level) / scale."""

    z_mean: Array  # (d,)
    z_scale: Array  # (d,)
    centre: Array  # (levels,)
    scale: float  # one for all levels, so that rho = 1 means "the level below plus a difference"

    def inputs(self, z: Array) -> Array:
        """Standardised inputs."""
        return (z - self.z_mean) / self.z_scale


def rows_of(z: Array, level: IntArray, value: Array) -> Rows:
    """Merge replicates: runs with the same z and level."""
    keys = np.column_stack([level, z])
    distinct, inverse, replicates = np.unique(keys, axis=0, return_inverse=True, return_counts=True)
    levels, index = np.unique(distinct[:, 0].astype(np.int64), return_inverse=True)
    return Rows(
        levels=tuple(int(k) for k in levels),
        z=distinct[:, 1:],
        index=index.astype(np.int64),
        replicates=replicates.astype(np.int64),
        group=inverse.reshape(-1).astype(np.int64),
        value=value,
    )


def subset(rows: Rows, keep: IntArray) -> Rows:
    """The rows `keep` (ascending) with their runs; each level must keep a row."""
    position = np.full(len(rows.z), -1)
    position[keep] = np.arange(len(keep))
    group = position[rows.group]
    return Rows(
        levels=rows.levels,
        z=rows.z[keep],
        index=rows.index[keep],
        replicates=rows.replicates[keep],
        group=group[group >= 0],
        value=rows.value[group >= 0],
    )


def spread_rows(rows: Rows, limit: int) -> IntArray:
    """Rows (ascending), at most `limit`: small levels whole, large ones thinned.

    The levels share the limit equally; larger levels get what smaller levels do not need. Within a
    level the chosen rows are spread evenly over the order of values.
    """
    means, left, chosen = group_means(rows, rows.value), limit, []
    own = [np.flatnonzero(rows.index == k) for k in range(len(rows.levels))]
    own.sort(key=len)
    for k, candidates in enumerate(own):
        share = min(len(candidates), left // (len(own) - k))
        order = candidates[np.argsort(means[candidates], kind="stable")]
        chosen.append(order[np.linspace(0, len(order) - 1, share).round().astype(np.int64)])
        left -= share
    return np.sort(np.concatenate(chosen))


def group_means(rows: Rows, values: Array) -> Array:
    """Mean over the runs of each row (n,)."""
    return np.bincount(rows.group, values, minlength=len(rows.z)) / rows.replicates


def scaling_of(rows: Rows, warp: Warp) -> Scaling:
    """Standardise inputs over all rows, outputs around the mean of their level."""
    z_scale = rows.z.std(axis=0)
    z_scale[z_scale <= 1e-12 * (1.0 + np.abs(rows.z).max(axis=0))] = 1.0
    y = group_means(rows, warp.forward(rows.value))
    smallest = max(SMALLEST_SCALE * float(np.abs(y).max() or 1.0), SMALLEST_WARP)
    levels = range(len(rows.levels))
    centre = np.array([y[rows.index == k].mean() for k in levels])
    within = float((y - centre[rows.index]).std())
    scale = max(within or float(y.std()) or float(warp.forward(rows.value).std()), smallest)
    return Scaling(rows.z.mean(axis=0), z_scale, centre, scale)


def outputs(rows: Rows, warp: Warp, scaling: Scaling) -> Array:
    """Standardised outputs (n,)."""
    means = group_means(rows, warp.forward(rows.value))
    result: Array = (means - scaling.centre[rows.index]) / scaling.scale
    return result
