"""Neighbour lists: which spheres may touch which spheres and triangles for the next steps.

Spheres are found by cells that are numbered modulo the size of a small table; two cells of the
same number are so far apart that the distance tells. `list_pairs` and `list_walls` return False
where the arrays are too short, to be called again with longer ones.
"""

import math

import numpy as np

from fidelity.dem.compiled import compiled, inlined
from fidelity.dem.history import recall_pairs, recall_walls
from fidelity.dem.moving import to_body
from fidelity.dem.state import ENTRIES, GRAINS, PAIRS, STALE
from fidelity.dem.triangle import nearest_on_triangle

SLACK = 1e-3  # of a reach: more than single precision loses over a thousand radii


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
        x = math.floor(place[i, 0] * inverse) & mask_x
        y = math.floor(place[i, 1] * inverse) & mask_y
        z = math.floor(place[i, 2] * inverse) & mask_z
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
        x = math.floor(place[i, 0] * inverse)
        y = math.floor(place[i, 1] * inverse)
        z = math.floor(place[i, 2] * inverse)
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
def list_walls(state, walls, surface, grid, scratch, per_grain, time):  # type: ignore[no-untyped-def]
    """Make the list of spheres at walls that are there at `time`; False if there is no room."""
    place, listed, moving = state.spheres.place, state.spheres.listed, state.moving
    spheres = state.counts[GRAINS] * per_grain
    entries = count = 0
    for i in range(spheres):
        scratch.entry[i] = -1
        first = count
        for b in range(grid.low.shape[0]):
            if time >= moving.until[b]:
                continue
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
    recall_walls(walls, scratch)
    return True
