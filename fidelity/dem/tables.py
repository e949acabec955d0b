"""Everything that a step reads and changes, made from a setup."""

from typing import NamedTuple

import numpy as np

from fidelity.dem.integrate import Field
from fidelity.dem.law import Law, Pair, law_of, pair_of
from fidelity.dem.moving import new_moving
from fidelity.dem.scratch import Scratch, new_scratch
from fidelity.dem.skin import Reach
from fidelity.dem.state import (
    WALL_CONTACTS,
    Pairs,
    State,
    Touching,
    WallPairs,
    new_pairs,
    new_state,
    new_touching,
    new_wall_pairs,
)
from fidelity.dem.surface import Grid, Surface, bodies_of, build_grid, build_surface
from fidelity.engine import Setup
from mfopt.arrays import Array, IntArray

# What `advance` came back for.
DONE, MORE_KEPT, MORE_PAIRS, MORE_WALLS = range(4)
# How far the making of lists has come.
FRESH, STORED, KEPT, PAIRED = range(4)

# Skins of the neighbour lists: at rest and at most [radius], and how many steps' way is added.
# Others from 0.1, 0.45, 8 to 0.25, 1, 16 took the same time within what the machine scatters.
LEAST_SKIN, MOST_SKIN, STEPS_AHEAD = 0.15, 0.7, 10
ROOM = 1.5  # arrays that are too short become so many times as long


class Tables(NamedTuple):
    """Everything that a step reads and changes."""

    state: State
    pairs: Pairs
    touching: Touching
    walls: WallPairs
    scratch: Scratch
    stage: IntArray  # (1,) how far an interrupted making of lists had come, see `advance`
    surface: Surface
    grid: Grid
    reach: Reach
    law: Law
    pair: Pair
    materials: Array  # (w, 3) constants of the contacts with each wall, see `Pair`
    shape: Array  # (k, 4) centre and radius of each sphere in the grain's frame [m]
    field: Field
    dt: float  # [s]
    # Contacts of one sphere with walls while they are worked out.
    found: Array
    keys: IntArray


def prepare(setup: Setup, dt: float) -> Tables:
    """Allocate everything for `setup`."""
    bodies, body = bodies_of(setup.walls)
    surface = build_surface(setup.walls, body)
    state = new_state(setup, new_moving(bodies, surface))
    s = len(state.spheres.owner)
    radii = state.spheres.place[:, 3]
    reach = Reach(
        least=LEAST_SKIN * float(radii.min()),
        most=MOST_SKIN * float(radii.max()),
        ahead=STEPS_AHEAD * dt,
        radius=float(radii.max()),
    )
    grain, physics = setup.grain, setup.physics
    material = setup.grain_material
    on_walls = [
        pair_of(material, w.material, physics, wall=True, friction_angle=w.friction_angle)
        for w in setup.walls
    ]
    return Tables(
        state=state,
        pairs=new_pairs(12 * s + 64),
        touching=new_touching(12 * s + 64, rolling=physics.rolling_friction > 0.0),
        walls=new_wall_pairs(s + 1, 4 * s + 64),
        scratch=new_scratch(s, 3 * s + 64, s + 1),
        stage=np.zeros(1, dtype=np.int64),
        surface=surface,
        grid=build_grid(surface, len(bodies), reach.radius + 2 * reach.most),
        reach=reach,
        law=law_of(physics),
        pair=pair_of(material, material, physics, wall=False),
        materials=np.array([tuple(on) for on in on_walls] or [(0.0, 0.0, 0.0)]),
        shape=np.column_stack([grain.offsets, grain.radii]),
        field=Field(
            gravity=-physics.gravity * physics.gravity_direction[2],
            side_x=physics.gravity * physics.gravity_direction[0],
            side_y=physics.gravity * physics.gravity_direction[1],
            damping=physics.damping,
            damp_gravity=physics.damp_gravity or setup.settle,
            linear_drag=physics.linear_drag,
            quadratic_drag=physics.quadratic_drag,
            forces=np.array(
                [[*f.lower, *f.upper, *f.acceleration] for f in physics.body_forces]
            ).reshape(-1, 9),
            exit_z=setup.exit_z,
        ),
        dt=dt,
        found=np.zeros((WALL_CONTACTS, 11)),
        keys=np.zeros((WALL_CONTACTS, 3), dtype=np.int64),
    )


def with_more_room(tables: Tables, wanted: int) -> Tables:
    """The tables with longer arrays where `advance` wanted them."""
    s = len(tables.state.spheres.owner)
    if wanted == MORE_PAIRS:
        room = int(ROOM * len(tables.pairs.other)) + s
        touching = new_touching(room, rolling=tables.law.rolling > 0.0)
        return tables._replace(pairs=new_pairs(room), touching=touching)
    if wanted == MORE_KEPT:
        scratch = tables.scratch
        room = int(ROOM * len(scratch.kept_other)) + s
        return tables._replace(scratch=new_scratch(s, room, len(scratch.wall_sphere)))
    room = int(ROOM * len(tables.walls.triangle)) + s
    return tables._replace(walls=new_wall_pairs(len(tables.walls.sphere), room))
