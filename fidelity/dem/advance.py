"""The loop over time steps."""

from fidelity.dem.compiled import compiled
from fidelity.dem.history import sort_history, store_history
from fidelity.dem.integrate import integrate
from fidelity.dem.lists import list_pairs, list_walls
from fidelity.dem.moving import place_bodies
from fidelity.dem.pairs import pair_forces
from fidelity.dem.skin import set_skins, walls_are_stale
from fidelity.dem.state import ELASTIC, GRAINS, KINETIC, POTENTIAL, STALE, STEP
from fidelity.dem.tables import (
    DONE,
    FRESH,
    KEPT,
    MORE_KEPT,
    MORE_PAIRS,
    MORE_WALLS,
    PAIRED,
    STORED,
)
from fidelity.dem.wall_contacts import wall_forces


@compiled
def advance(t, steps):  # type: ignore[no-untyped-def]
    """Take up to `steps` steps with the tables `t`; the last one measures the energies.

    Returns:
        steps taken, and `DONE` or which arrays are too short to go on.
    """
    state, counts, dt = t.state, t.state.counts, t.dt
    for taken in range(steps):
        time = counts[STEP] * dt
        place_bodies(state.moving, time, dt)
        if counts[STALE] or t.stage[0] != FRESH or walls_are_stale(state.moving, state.drift, time):
            wanted = make_lists(t, time)
            if wanted != DONE:
                return taken, wanted
        if counts[GRAINS] == 0:
            return taken, DONE
        measure = taken == steps - 1
        if measure:
            for c in (KINETIC, POTENTIAL, ELASTIC):
                state.budget[c] = 0.0  # those of this moment
        for w in range(state.wall_force.shape[0]):
            for c in range(3):
                state.wall_force[w, c] = 0.0
        counts[STEP] += 1
        pair_forces(state, t.pairs, t.touching, t.law, t.pair, dt, measure)
        wall_forces(state, t.walls, t.surface, t.law, t.materials, dt, measure, t.found, t.keys)
        kick, viscous = 0.5 if counts[STEP] == 1 else 1.0, t.law.zeta > 0.0
        integrate(state, t.shape, t.field, time, dt, kick, viscous, measure)
    return steps, DONE


@compiled
def make_lists(t, time):  # type: ignore[no-untyped-def]
    """Make the neighbour lists, or go on making them; `DONE` or what is too short."""
    state, k = t.state, t.shape.shape[0]
    rolling = t.law.rolling > 0.0
    if t.stage[0] == FRESH:
        if not store_history(state, t.pairs, t.touching, t.walls, t.scratch, rolling):
            return MORE_KEPT
        t.stage[0] = STORED
    if t.stage[0] == STORED:
        sort_history(t.scratch, state.counts[GRAINS] * k)
        set_skins(state, t.reach, k, time)
        t.stage[0] = KEPT
    if t.stage[0] == KEPT:
        if not list_pairs(state, t.pairs, t.touching, t.scratch, t.reach, rolling, k):
            return MORE_PAIRS
        t.stage[0] = PAIRED
    if not list_walls(state, t.walls, t.surface, t.grid, t.scratch, k, time):
        return MORE_WALLS
    t.stage[0] = FRESH
    return DONE
