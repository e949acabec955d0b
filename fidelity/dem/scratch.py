"""Room for making the neighbour lists, allocated once."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fidelity.dem.state import HISTORY, WALL_CONTACTS
from mfopt.arrays import Array, IntArray


class Scratch(NamedTuple):
    """Room for making the lists, allocated once."""

    bucket: IntArray  # (s,) of each sphere
    table: IntArray  # (buckets + 1,) start of each bucket
    # What the cell number along each axis, modulo the length of these, adds to the bucket's number.
    bucket_x: IntArray
    bucket_y: IntArray
    bucket_z: IntArray
    sorted: Array  # (s, 4) centre and radius plus skin, by bucket
    sphere: NDArray[np.uint32]  # (s,) its row
    owner: NDArray[np.uint32]  # (s,) its grain
    # Of one bucket and its neighbours, in single precision; SLACK makes up for it.
    near_x: NDArray[np.float32]  # (s,) centre
    near_y: NDArray[np.float32]
    near_z: NDArray[np.float32]
    near_r: NDArray[np.float32]  # (s,) radius and skin
    near_owner: NDArray[np.uint32]  # (s,) grain
    near_row: NDArray[np.uint32]  # (s,) sphere
    close: NDArray[np.uint8]  # (s,)
    # Histories of touching contacts while the lists are made.
    kept_start: NDArray[np.uint64]  # (s + 1,)
    kept_other: NDArray[np.uint32]  # (c,)
    kept_low: NDArray[np.uint8]  # (s,) whether a sphere is the lower, the higher of a kept pair
    kept_high: NDArray[np.uint8]  # (s,)
    kept: Array  # (c, 6)
    raw: IntArray  # (c, 2) rows of both spheres
    raw_kept: Array  # (c, 6)
    wall_sphere: IntArray  # (e,)
    wall_count: IntArray  # (e,)
    wall_key: IntArray  # (e, 8)
    wall_history: Array  # (e, 8, 9)
    entry: IntArray  # (s,) wall entry of a sphere, or -1
    kept_counts: IntArray  # (2,) pairs and wall entries kept


def new_scratch(spheres: int, contacts: int, entries: int) -> Scratch:
    """Room for so many."""
    bits = max(9, int(np.ceil(np.log2(2 * spheres))))
    along = [(bits + 2 - axis) // 3 for axis in range(3)]  # bits of each axis
    buckets = [spread(np.arange(1 << n), axis, along) for axis, n in enumerate(along)]
    return Scratch(
        bucket=_ints(spheres),
        table=_ints((1 << bits) + 1),
        bucket_x=buckets[0],
        bucket_y=buckets[1],
        bucket_z=buckets[2],
        sorted=np.zeros((spheres, 4)),
        sphere=np.zeros(spheres, dtype=np.uint32),
        owner=np.zeros(spheres, dtype=np.uint32),
        near_x=np.zeros(spheres, dtype=np.float32),
        near_y=np.zeros(spheres, dtype=np.float32),
        near_z=np.zeros(spheres, dtype=np.float32),
        near_r=np.zeros(spheres, dtype=np.float32),
        near_owner=np.zeros(spheres, dtype=np.uint32),
        near_row=np.zeros(spheres, dtype=np.uint32),
        close=np.zeros(spheres, dtype=np.uint8),
        kept_start=np.zeros(spheres + 1, dtype=np.uint64),
        kept_other=np.zeros(contacts, dtype=np.uint32),
        kept_low=np.zeros(spheres, dtype=np.uint8),
        kept_high=np.zeros(spheres, dtype=np.uint8),
        kept=np.zeros((contacts, 6)),
        raw=_ints(contacts, 2),
        raw_kept=np.zeros((contacts, 6)),
        wall_sphere=_ints(entries),
        wall_count=_ints(entries),
        wall_key=_ints(entries, WALL_CONTACTS),
        wall_history=np.zeros((entries, WALL_CONTACTS, HISTORY)),
        entry=_ints(spheres),
        kept_counts=_ints(2),
    )


def _ints(*shape: int) -> IntArray:
    return np.zeros(shape, dtype=np.int64)


def spread(numbers: IntArray, axis: int, bits: Sequence[int]) -> IntArray:
    """Bits of `numbers` at their places in an interleaved number: x0, y0, z0, x1, y1, z1, ...

    Cells that are near in space then have numbers that are near (Morton order), so that what is
    worked on at one time fits the cache.

    Args:
        numbers: of cells along `axis`.
        axis: 0, 1 or 2.
        bits: of each axis.
    """
    result, place = np.zeros_like(numbers), 0
    for bit in range(max(bits)):
        for a in range(3):
            if bit < bits[a]:
                if a == axis:
                    result |= ((numbers >> bit) & 1) << place
                place += 1
    return result
