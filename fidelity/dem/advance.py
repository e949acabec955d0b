"""The loop over time steps."""

from fidelity.dem.compiled import compiled
from fidelity.dem.integrate import integrate
from fidelity.dem.moving import place_bodies
from fidelity.dem.neighbours import (
    list_pairs,
    list_walls,
    set_skins,
    sort_history,
    store_history,
    walls_are_stale,
)
from fidelity.dem.pairs import pair_forces
from fidelity.dem.state import ELASTIC, GRAINS, KINETIC, POTENTIAL, STALE, STEP
from fidelity.dem.wall_contacts import wall_forces

# What `advance` came back for.
DONE, MORE_KEPT, MORE_PAIRS, MORE_WALLS = range(4)
# How far the making of lists has come.
FRESH, STORED, KEPT, PAIRED = range(4)


@compiled
def advance(  # type: ignore[no-untyped-def]
    state, pairs, touching, walls, scratch, stage, surface, grid, reach, law, pair, materials, shape, field,
    dt, steps, found, keys,
):  # fmt: skip
    """Take up to `steps` steps; the last one measures the energies.

    Args:
        stage: (1,) how far an interrupted making of lists had come.
        For all others see the modules of their names.

    Returns:
        steps taken, and `DONE` or which arrays are too short to go on.
    """
    counts = state.counts
    k = shape.shape[0]
    rolling = law.rolling > 0.0
    for taken in range(steps):
        time = counts[STEP] * dt
        place_bodies(state.moving, time, dt)
        if counts[STALE] or stage[0] != FRESH or walls_are_stale(state.moving, state.drift, time):
            if stage[0] == FRESH:
                if not store_history(state, pairs, touching, walls, scratch, rolling):
                    return taken, MORE_KEPT
                stage[0] = STORED
            if stage[0] == STORED:
                sort_history(scratch, counts[GRAINS] * k)
                set_skins(state, reach, k, time)
                stage[0] = KEPT
            if stage[0] == KEPT:
                if not list_pairs(state, pairs, touching, scratch, reach, rolling, k):
                    return taken, MORE_PAIRS
                stage[0] = PAIRED
            if not list_walls(state, walls, surface, grid, scratch, reach, k):
                return taken, MORE_WALLS
            stage[0] = FRESH
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
        pair_forces(state, pairs, touching, law, pair, dt, measure)
        wall_forces(state, walls, surface, law, materials, dt, measure, found, keys)
        kick = 0.5 if counts[STEP] == 1 else 1.0
        integrate(state, shape, field, time, dt, kick, measure)
    return steps, DONE
