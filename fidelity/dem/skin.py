"""How far a sphere or a wall may go before the neighbour lists are stale.

A sphere's skin grows with its speed: fast grains are few and far apart, and would otherwise
make everybody's lists stale. All ways and speeds are against a drift that most grains share:
that of the cup that they ride in.
"""

import math
from typing import NamedTuple

import numpy as np

from fidelity.dem.compiled import compiled
from fidelity.dem.moving import moved_since_listed
from fidelity.dem.state import GRAINS


class Reach(NamedTuple):
    """How far the lists look ahead."""

    least: float  # [m] skin of a sphere at rest
    most: float  # [m] skin of the fastest
    ahead: float  # [s] the skin is the way of this time
    radius: float  # [m] of the largest sphere


@compiled
def set_skins(state, reach, per_grain, time):  # type: ignore[no-untyped-def]
    """Note where all spheres and bodies are, and how far each may go."""
    place, listed, drift = state.spheres.place, state.spheres.listed, state.drift
    kin = state.bodies.kinematics
    drift[3] = time
    fastest = 0.0
    for g in range(np.uint64(state.counts[GRAINS])):
        ux, uy, uz = kin[g, 3] - drift[0], kin[g, 4] - drift[1], kin[g, 5] - drift[2]
        for i in range(g * np.uint64(per_grain), (g + np.uint64(1)) * np.uint64(per_grain)):
            bx, by, bz = place[i, 0] - kin[g, 0], place[i, 1] - kin[g, 1], place[i, 2] - kin[g, 2]
            vx = ux + kin[g, 7] * bz - kin[g, 8] * by
            vy = uy + kin[g, 8] * bx - kin[g, 6] * bz
            vz = uz + kin[g, 6] * by - kin[g, 7] * bx
            way = reach.ahead * math.sqrt(vx * vx + vy * vy + vz * vz)
            fastest = max(fastest, way)
            skin = min(reach.most, reach.least + way)
            listed[i, 0], listed[i, 1], listed[i, 2] = place[i, 0], place[i, 1], place[i, 2]
            listed[i, 3] = skin * skin
    moving, fastest_wall = state.moving, 0.0
    for b in range(moving.place.shape[0]):
        speed = spin = 0.0
        for c in range(3):
            speed += (moving.velocity[b, c] - drift[c]) ** 2
            spin += moving.spin[b, c] ** 2
            moving.listed[b, c] = moving.place[b, c]
        way = reach.ahead * (math.sqrt(speed) + math.sqrt(spin) * moving.reach[b])
        fastest_wall = max(fastest_wall, way)
        moving.listed[b, 3] = moving.angle[b]
        moving.listed[b, 4] = min(reach.most, way + (reach.least if way > 0.0 else 0.0))
    drift[4] = (fastest + fastest_wall) / reach.ahead


@compiled
def walls_are_stale(moving, drift, time):  # type: ignore[no-untyped-def]
    """Whether a body has moved further than its skin, or is gone since the lists were made."""
    for b in range(moving.place.shape[0]):
        if drift[3] < moving.until[b] <= time:
            return True
        if moved_since_listed(moving, b, drift, time) > moving.listed[b, 4]:
            return True
    return False
