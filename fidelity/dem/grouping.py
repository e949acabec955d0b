"""Taking grains out that have left, and sorting the others by place so that neighbours are near."""

import numpy as np

from fidelity.dem import state as at
from fidelity.dem.history import store_history
from fidelity.dem.integrate import Field
from fidelity.dem.scratch import spread
from fidelity.dem.state import State
from fidelity.dem.tables import FRESH, STORED, Tables
from mfopt.arrays import IntArray

CELL = 4.0  # [sphere radii] grains are sorted by cells of this size
BITS = (20, 20, 20)


def regroup(tables: Tables) -> None:
    """Give every staying grain a new row; the lists are made again before the next step."""
    t, state, k = tables, tables.state, len(tables.shape)
    if t.stage[0] != FRESH or not store_history(
        state, t.pairs, t.touching, t.walls, t.scratch, t.law.rolling > 0.0
    ):
        return  # at the next look
    n = int(state.counts[at.GRAINS])
    left = state.bodies.left[:n]
    state.budget[at.CARRIED] += _energy(state, np.flatnonzero(left), t.field)
    staying = np.flatnonzero(~left)
    order = staying[_by_place(state, staying)]
    new_row = np.full(n, -1)
    new_row[order] = np.arange(len(order))
    _move(state, order, k)
    state.counts[at.GRAINS] = len(order)
    if len(order):
        state.drift[:3] = np.median(state.bodies.kinematics[: len(order), 3:6], axis=0)
    _carry(tables, new_row, k)
    state.counts[at.STALE], t.stage[0] = 1, STORED


def _energy(state: State, rows: IntArray, field: Field) -> float:
    """Kinetic and potential energy of some grains [J]."""
    bodies = state.bodies
    mass, x = bodies.inertia[rows, 0], bodies.kinematics[rows]
    spin = (bodies.momentum[rows] * x[:, 6:9]).sum(axis=1)
    kinetic = 0.5 * (mass * (x[:, 3:6] ** 2).sum(axis=1) + spin)
    aside = field.side_x * x[:, 0] + field.side_y * x[:, 1]
    return float((kinetic + mass * field.gravity * x[:, 2] - mass * aside).sum())


def _by_place(state: State, rows: IntArray) -> IntArray:
    """Order of the cells that they are in, see `spread`."""
    cell = CELL * float(state.spheres.place[:, 3].max())
    numbers = np.floor(state.bodies.kinematics[rows, :3] / cell).astype(np.int64)
    numbers = (numbers - numbers.min(axis=0, initial=0)).clip(max=(1 << BITS[0]) - 1)
    key = sum(spread(numbers[:, axis], axis, BITS) for axis in range(3))
    return np.argsort(key, kind="stable")


def _move(state: State, order: IntArray, k: int) -> None:
    n = len(order)
    for rows in state.bodies:
        rows[:n] = rows[order]
    spheres = (order[:, None] * k + np.arange(k)).ravel()
    state.spheres.place[: n * k] = state.spheres.place[spheres]


def _carry(tables: Tables, new_row: IntArray, k: int) -> None:
    """Rows of the stored histories; those of grains that were taken out are dropped."""
    kept = tables.scratch
    pairs, walls = int(kept.kept_counts[0]), int(kept.kept_counts[1])
    body = new_row[kept.raw[:pairs] // k]
    here = (body >= 0).all(axis=1)
    kept.kept_counts[0] = m = int(here.sum())
    kept.raw[:m] = (body * k + kept.raw[:pairs] % k)[here]
    kept.raw_kept[:m] = kept.raw_kept[:pairs][here]
    body = new_row[kept.wall_sphere[:walls] // k]
    here = body >= 0
    kept.kept_counts[1] = m = int(here.sum())
    kept.wall_sphere[:m] = (body * k + kept.wall_sphere[:walls] % k)[here]
    for rows in (kept.wall_count, kept.wall_key, kept.wall_history):
        rows[:m] = rows[:walls][here]
