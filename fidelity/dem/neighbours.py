"""Neighbour lists: which spheres may touch which spheres and triangles for the next steps.

A sphere's skin is the way that it may go before the lists are stale. It grows with its speed:
fast grains are few and far apart, and would otherwise make everybody's lists stale. All ways and
speeds are against a drift that most grains share: that of the cup that they ride in. Spheres are
found by cells that are numbered modulo the size of a small table; two cells of the same number are
so far apart that the distance tells.

The histories of touching contacts are carried over. `list_pairs` and `list_walls` return False where
the arrays are too short, to be called again with longer ones.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fidelity.dem.compiled import compiled, inlined
from fidelity.dem.moving import moved_since_listed
from fidelity.dem.state import (
    ENTRIES,
    GRAINS,
    PAIRS,
    SIDE,
    STALE,
    TOUCHING,
    HISTORY,
    WALL_CONTACTS,
)
from fidelity.dem.triangle import nearest_on_triangle
from fidelity.dem.wall_contacts import to_body
from mfopt.arrays import Array, IntArray


SLACK = 1e-3  # of a reach: more than single precision loses over a thousand radii


class Reach(NamedTuple):
    """How far the lists look ahead."""

    least: float  # [m] skin of a sphere at rest
    most: float  # [m] skin of the fastest
    ahead: float  # [s] the skin is the way of this time
    radius: float  # [m] of the largest sphere


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
    ints = lambda *shape: np.zeros(shape, dtype=np.int64)  # noqa: E731
    return Scratch(
        ints(spheres),
        ints((1 << bits) + 1),
        *(spread(np.arange(1 << n), axis, along) for axis, n in enumerate(along)),
        np.zeros((spheres, 4)),
        np.zeros(spheres, dtype=np.uint32),
        np.zeros(spheres, dtype=np.uint32),
        *(np.zeros(spheres, dtype=np.float32) for _ in range(4)),
        *(np.zeros(spheres, dtype=np.uint32) for _ in range(2)),
        np.zeros(spheres, dtype=np.uint8),
        np.zeros(spheres + 1, dtype=np.uint64),
        np.zeros(contacts, dtype=np.uint32),
        np.zeros(spheres, dtype=np.uint8),
        np.zeros(spheres, dtype=np.uint8),
        np.zeros((contacts, 6)),
        ints(contacts, 2),
        np.zeros((contacts, 6)),
        ints(entries),
        ints(entries),
        ints(entries, WALL_CONTACTS),
        np.zeros((entries, WALL_CONTACTS, HISTORY)),
        ints(spheres),
        ints(2),
    )


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


@compiled
def store_history(state, pairs, touching, walls, scratch, rolling):  # type: ignore[no-untyped-def]
    """Set the histories of touching contacts aside; False if there is no room."""
    side, count = state.counts[SIDE], state.counts[TOUCHING]
    if count > scratch.raw.shape[0]:
        return False
    for c in range(count):
        p = touching.pair[side, c]
        scratch.raw[c, 0], scratch.raw[c, 1] = pairs.first[p], pairs.other[p]
        for d in range(3):
            scratch.raw_kept[c, d] = touching.force[side, c, d]
            scratch.raw_kept[c, 3 + d] = touching.moment[side, c, d] if rolling else 0.0
    kept = 0
    for e in range(state.counts[ENTRIES]):
        if walls.touching[e] > 0:
            if kept == scratch.wall_sphere.shape[0]:
                return False
            scratch.wall_sphere[kept] = walls.sphere[e]
            scratch.wall_count[kept] = walls.touching[e]
            for a in range(walls.touching[e]):
                scratch.wall_key[kept, a] = walls.key[e, a]
                for c in range(HISTORY):
                    scratch.wall_history[kept, a, c] = walls.history[e, a, c]
            kept += 1
    scratch.kept_counts[0], scratch.kept_counts[1] = count, kept
    return True


@compiled
def sort_history(scratch, spheres):  # type: ignore[no-untyped-def]
    """Sort the kept histories by the lower of their two sphere rows."""
    start = scratch.kept_start
    low, high = scratch.kept_low, scratch.kept_high
    start[spheres] = 0
    for i in range(spheres):
        start[i] = low[i] = high[i] = 0
    count = scratch.kept_counts[0]
    for c in range(count):
        i, j = scratch.raw[c, 0], scratch.raw[c, 1]
        if i > j:  # seen from the other sphere
            scratch.raw[c, 0], scratch.raw[c, 1] = j, i
            for d in range(6):
                scratch.raw_kept[c, d] = -scratch.raw_kept[c, d]
        low[min(i, j)] = high[max(i, j)] = 1
        start[min(i, j) + 1] += np.uint64(1)
    for i in range(spheres):
        start[i + 1] += start[i]
    for c in range(count):
        i = scratch.raw[c, 0]
        q = start[i]
        start[i] += np.uint64(1)
        scratch.kept_other[q] = scratch.raw[c, 1]
        for d in range(6):
            scratch.kept[q, d] = scratch.raw_kept[c, d]
    for i in range(spheres, 0, -1):  # the starts have moved up by one row
        start[i] = start[i - 1]
    start[0] = 0


@compiled
def set_skins(state, reach, per_grain, time):  # type: ignore[no-untyped-def]
    """Note where all spheres and bodies are, and how far each may go."""
    place, listed, drift = state.spheres.place, state.spheres.listed, state.drift
    kin = state.bodies.kinematics
    drift[3] = time
    for g in range(np.uint64(state.counts[GRAINS])):
        ux, uy, uz = kin[g, 3] - drift[0], kin[g, 4] - drift[1], kin[g, 5] - drift[2]
        for i in range(g * np.uint64(per_grain), (g + np.uint64(1)) * np.uint64(per_grain)):
            bx, by, bz = place[i, 0] - kin[g, 0], place[i, 1] - kin[g, 1], place[i, 2] - kin[g, 2]
            vx = ux + kin[g, 7] * bz - kin[g, 8] * by
            vy = uy + kin[g, 8] * bx - kin[g, 6] * bz
            vz = uz + kin[g, 6] * by - kin[g, 7] * bx
            way = reach.ahead * math.sqrt(vx * vx + vy * vy + vz * vz)
            skin = min(reach.most, reach.least + way)
            listed[i, 0], listed[i, 1], listed[i, 2] = place[i, 0], place[i, 1], place[i, 2]
            listed[i, 3] = skin * skin
    moving = state.moving
    for b in range(moving.place.shape[0]):
        speed = spin = 0.0
        for c in range(3):
            speed += (moving.velocity[b, c] - drift[c]) ** 2
            spin += moving.spin[b, c] ** 2
            moving.listed[b, c] = moving.place[b, c]
        way = reach.ahead * (math.sqrt(speed) + math.sqrt(spin) * moving.reach[b])
        moving.listed[b, 3] = moving.angle[b]
        moving.listed[b, 4] = min(reach.most, way + (reach.least if way > 0.0 else 0.0))


@compiled
def walls_are_stale(moving, drift, time):  # type: ignore[no-untyped-def]
    """Whether a body has moved further than its skin."""
    for b in range(moving.place.shape[0]):
        if moved_since_listed(moving, b, drift, time) > moving.listed[b, 4]:
            return True
    return False


@compiled
def list_pairs(state, pairs, touching, scratch, reach, rolling, per_grain):  # type: ignore[no-untyped-def]
    """Make the pair list; False if there is no room."""
    place, listed = state.spheres.place, state.spheres.listed
    spheres = state.counts[GRAINS] * per_grain
    table, near, row, owner = scratch.table, scratch.sorted, scratch.sphere, scratch.owner
    buckets = table.shape[0] - 1
    bucket_x, bucket_y, bucket_z = scratch.bucket_x, scratch.bucket_y, scratch.bucket_z
    mask_x, mask_y, mask_z = len(bucket_x) - 1, len(bucket_y) - 1, len(bucket_z) - 1
    widest = 0.0
    for i in range(spheres):
        widest = max(widest, listed[i, 3])
    inverse = 1.0 / (2.0 * (1.0 + SLACK) * (reach.radius + math.sqrt(widest)))
    for b in range(buckets + 1):
        table[b] = 0
    for i in range(spheres):
        x = int(math.floor(place[i, 0] * inverse)) & mask_x
        y = int(math.floor(place[i, 1] * inverse)) & mask_y
        z = int(math.floor(place[i, 2] * inverse)) & mask_z
        b = bucket_x[x] + bucket_y[y] + bucket_z[z]
        scratch.bucket[i] = b
        table[b + 1] += 1
    for b in range(buckets):
        table[b + 1] += table[b]
    for i in range(spheres):
        q = table[scratch.bucket[i]]
        table[scratch.bucket[i]] += 1
        for c in range(3):
            near[q, c] = place[i, c] - place[0, c]
        near[q, 3] = (1.0 + SLACK) * (place[i, 3] + math.sqrt(listed[i, 3]))
        row[q], owner[q] = i, state.spheres.owner[i]
    for b in range(buckets, 0, -1):  # the starts have moved up by one bucket
        table[b] = table[b - 1]
    table[0] = 0
    count = 0
    for b in range(buckets):
        if table[b] == table[b + 1]:
            continue
        i = row[table[b]]
        x = int(math.floor(place[i, 0] * inverse))
        y = int(math.floor(place[i, 1] * inverse))
        z = int(math.floor(place[i, 2] * inverse))
        total = collect(scratch, x, y, z)
        here = table[b + 1] - table[b]
        if count + here * total > pairs.other.shape[0]:
            return False
        for p in range(here):
            count = match(scratch, np.uint64(p), np.uint64(total), pairs, np.uint64(count))
    state.counts[PAIRS] = count
    recall_pairs(state, pairs, touching, scratch, rolling)
    state.counts[STALE] = 0
    return True


@inlined
def collect(scratch, x, y, z):  # type: ignore[no-untyped-def]
    """Copy the spheres of cell (x, y, z), then those of half of its neighbours; their number."""
    table, one = scratch.table, np.uint64(1)
    bucket_x, bucket_y, bucket_z = scratch.bucket_x, scratch.bucket_y, scratch.bucket_z
    mask_x, mask_y, mask_z = len(bucket_x) - 1, len(bucket_y) - 1, len(bucket_z) - 1
    total = np.uint64(0)
    for line in range(5):  # the rest of this row of cells, and four whole rows
        dy = 0 if line == 0 else 1 if line == 1 else line - 3
        dz = 0 if line < 2 else 1
        base = bucket_y[(y + dy) & mask_y] + bucket_z[(z + dz) & mask_z]
        for dx in range(0 if line == 0 else -1, 2):
            b = base + bucket_x[(x + dx) & mask_x]
            for q in range(np.uint64(table[b]), np.uint64(table[b + 1])):
                scratch.near_x[total] = scratch.sorted[q, 0]
                scratch.near_y[total] = scratch.sorted[q, 1]
                scratch.near_z[total] = scratch.sorted[q, 2]
                scratch.near_r[total] = scratch.sorted[q, 3]
                scratch.near_owner[total] = scratch.owner[q]
                scratch.near_row[total] = scratch.sphere[q]
                total += one
    return np.int64(total)


@inlined
def match(scratch, p, total, pairs, count):  # type: ignore[no-untyped-def]
    """List the pairs of candidate p with those behind it; how long the list is then."""
    x, y, z, r, close = (
        scratch.near_x,
        scratch.near_y,
        scratch.near_z,
        scratch.near_r,
        scratch.close,
    )
    owner, row = scratch.near_owner, scratch.near_row
    first, other = pairs.first, pairs.other
    one = np.uint64(1)
    xp, yp, zp, rp, own = x[p], y[p], z[p], r[p], owner[p]
    for q in range(p + one, total):  # apart from the next loop, this one is done eight at a time
        dx, dy, dz, both = x[q] - xp, y[q] - yp, z[q] - zp, r[q] + rp
        close[q] = (dx * dx + dy * dy + dz * dz < both * both) & (owner[q] != own)
    start = count
    for q in range(p + one, total):
        other[count] = row[q]
        count += close[q]
    for c in range(start, count):
        first[c] = row[p]
    return np.int64(count)


@compiled
def recall_pairs(state, pairs, touching, scratch, rolling):  # type: ignore[no-untyped-def]
    """Give the pairs of the new list the histories that were set aside."""
    one, side, count = np.uint64(1), state.counts[SIDE], np.uint64(0)
    for p in range(np.uint64(state.counts[PAIRS])):
        i, j = pairs.first[p], pairs.other[p]
        low, high = min(i, j), max(i, j)
        if scratch.kept_low[low] & scratch.kept_high[high]:
            for q in range(scratch.kept_start[low], scratch.kept_start[np.uint64(low) + one]):
                if scratch.kept_other[q] == high:
                    sign = 1.0 if i < j else -1.0
                    touching.pair[side, count] = p
                    for d in range(3):
                        touching.force[side, count, d] = sign * scratch.kept[q, d]
                        if rolling:
                            touching.moment[side, count, d] = sign * scratch.kept[q, 3 + d]
                    count += one
    state.counts[TOUCHING] = count


@compiled
def list_walls(state, walls, surface, grid, scratch, reach, per_grain):  # type: ignore[no-untyped-def]
    """Make the list of spheres at walls; False if there is no room."""
    place, listed, moving = state.spheres.place, state.spheres.listed, state.moving
    spheres = state.counts[GRAINS] * per_grain
    entries = count = 0
    for i in range(spheres):
        scratch.entry[i] = -1
        first = count
        for b in range(grid.low.shape[0]):
            x, y, z = to_body(moving, b, place[i, 0], place[i, 1], place[i, 2])
            cx = math.floor((x - grid.low[b, 0]) / grid.cell[b])
            cy = math.floor((y - grid.low[b, 1]) / grid.cell[b])
            cz = math.floor((z - grid.low[b, 2]) / grid.cell[b])
            if not (
                0 <= cx < grid.shape[b, 0]
                and 0 <= cy < grid.shape[b, 1]
                and 0 <= cz < grid.shape[b, 2]
            ):
                continue
            cell = grid.first_cell[b] + (int(cx) * grid.shape[b, 1] + int(cy)) * grid.shape[b, 2]
            cell += int(cz)
            far = place[i, 3] + math.sqrt(listed[i, 3]) + moving.listed[b, 4]
            for q in range(grid.start[cell], grid.start[cell + 1]):
                t = grid.items[q]
                tri = surface.triangles[t]
                off = (
                    surface.normals[t, 0] * (x - tri[0])
                    + surface.normals[t, 1] * (y - tri[1])
                    + surface.normals[t, 2] * (z - tri[2])
                )
                if abs(off) >= far:
                    continue
                dx, dy, dz, _, _ = nearest_on_triangle(tri, x, y, z)
                if dx * dx + dy * dy + dz * dz < far * far:
                    if count == walls.triangle.shape[0]:
                        return False
                    walls.triangle[count] = t
                    count += 1
        if count > first:
            if entries == walls.sphere.shape[0]:
                return False
            walls.sphere[entries] = i
            walls.start[entries] = first
            walls.touching[entries] = 0
            scratch.entry[i] = entries
            entries += 1
    walls.start[entries] = count
    state.counts[ENTRIES] = entries
    for c in range(scratch.kept_counts[1]):
        e = scratch.entry[scratch.wall_sphere[c]]
        if e >= 0:
            walls.touching[e] = scratch.wall_count[c]
            for a in range(walls.touching[e]):
                walls.key[e, a] = scratch.wall_key[c, a]
                for d in range(HISTORY):
                    walls.history[e, a, d] = scratch.wall_history[c, a, d]
    return True
