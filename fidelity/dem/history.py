"""Histories of touching contacts, carried from one neighbour list to the next.

`store_history` sets them aside, `sort_history` makes them easy to find, and `recall_pairs` and
`recall_walls` give them to the contacts of the new lists.
"""

import numpy as np

from fidelity.dem.compiled import compiled
from fidelity.dem.state import ENTRIES, HISTORY, PAIRS, SIDE, TOUCHING


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
def recall_walls(walls, scratch):  # type: ignore[no-untyped-def]
    """Give the spheres at walls in the new list the histories that were set aside."""
    for c in range(scratch.kept_counts[1]):
        e = scratch.entry[scratch.wall_sphere[c]]
        if e >= 0:
            walls.touching[e] = scratch.wall_count[c]
            for a in range(walls.touching[e]):
                walls.key[e, a] = scratch.wall_key[c, a]
                for d in range(HISTORY):
                    walls.history[e, a, d] = scratch.wall_history[c, a, d]
