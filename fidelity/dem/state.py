"""What changes while a run goes on, as arrays that are allocated once.

Grains are kept sorted by place, so `bodies` row 7 is not grain 7 of the setup: `number` says
which it is. Spheres follow their grain: rows g k to g k + k - 1 are those of body g with k
spheres. Rows from `counts[GRAINS]` on are unused.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fidelity.engine import Setup, sizes
from mfopt.arrays import Array, IntArray

# Places in `counts`. CROSSED: 1 + number of the wall that a sphere's centre went through; 0: none.
GRAINS, STEP, STALE, PAIRS, ENTRIES, TOUCHING, SIDE, CROSSED = range(8)
# Places in `budget` [J]; see `energy`.
(
    KINETIC,
    POTENTIAL,
    ELASTIC,
    WALL_WORK,
    FORCE_WORK,
    SLIP,
    CONTACT_DAMPING,
    NUMERICAL_DAMPING,
    DRAG,
    CARRIED,
    OVERLAP,  # [m] largest seen
    LARGEST_KINETIC,
) = range(12)

BLOCK = 2048  # pairs that are looked at together
WALL_CONTACTS = 8  # of one sphere at once, at most
HISTORY = 9  # of a wall contact: normal, tangential force, rolling moment


class Bodies(NamedTuple):
    """The grains."""

    # (n, 16) position [m], velocity [m/s], angular velocity [rad/s]; force [N] and torque [N m] of
    # this step; and one place empty, so that a row is two lines of the cache.
    kinematics: Array
    quaternion: Array  # (n, 4) w, x, y, z: grain frame to space
    rotation: Array  # (n, 9) the same as a matrix, row by row
    momentum: Array  # (n, 3) angular momentum in space [kg m2/s]
    viscous: Array  # (n, 6) force [N] and torque [N m] of contact damping, part of the load
    inertia: Array  # (n, 4) mass [kg] and principal moments [kg m2]
    inverse: Array  # (n, 4) 1 / the same
    scale: Array  # (n,) size relative to the shape
    number: IntArray  # (n,) in the setup
    left: NDArray[np.bool_]  # (n,) below the exit, to be taken out


class Spheres(NamedTuple):
    """The spheres of the grains."""

    place: Array  # (s, 4) centre and radius [m]
    listed: Array  # (s, 4) centre when the lists were made [m], and squared skin [m2]
    owner: NDArray[np.uint32]  # (s,) body


class Pairs(NamedTuple):
    """Spheres of different grains that may touch before the lists are made again."""

    first: NDArray[np.uint32]  # (p,) sphere
    other: NDArray[np.uint32]  # (p,) sphere
    close: NDArray[np.uint8]  # (BLOCK,) of the pairs that are looked at, whether they touch now


class Touching(NamedTuple):
    """Pairs that touch, in the order of the pair list: those of the last step, and of this one.

    There is room for every pair of the list. Row `counts[SIDE]` of each array is the last step's;
    the other is filled while it is read.
    """

    pair: NDArray[np.uint32]  # (2, c) place in the pair list
    force: Array  # (2, c, 3) tangential spring force on the first sphere [N]
    moment: Array  # (2, c, 3) rolling moment on it [N m]; (2, 1, 3) without rolling friction


class WallPairs(NamedTuple):
    """Spheres that may touch a wall, the triangles in question, and their contacts."""

    sphere: NDArray[np.uint32]  # (e,)
    start: IntArray  # (e + 1,) into `triangle`
    triangle: NDArray[np.uint32]  # (q,)
    touching: IntArray  # (e,) contacts in the last step
    key: IntArray  # (e, 8) where each of them is on the surface
    history: Array  # (e, 8, 9)


class Moving(NamedTuple):
    """The bodies of the walls: where they are now, and their prescribed motion."""

    place: Array  # (b, 3) displacement [m]
    rotation: Array  # (b, 9)
    velocity: Array  # (b, 3) of the pivot, moved along [m/s]
    spin: Array  # (b, 3) [rad/s]
    mean_velocity: Array  # (b, 3) the same, over the step before and the step after
    mean_spin: Array  # (b, 3)
    angle: Array  # (b,) [rad]
    listed: Array  # (b, 5) displacement, angle, skin when the lists were made
    pivot: Array  # (b, 3) [m]
    axis: Array  # (b, 3)
    reach: Array  # (b,) [m] largest distance of a corner from the pivot
    until: Array  # (b,) [s] from then on the body is gone
    first: IntArray  # (b + 1,) into the samples
    times: Array  # (m,) [s]
    samples: Array  # (m, 4) displacement [m], angle [rad]


class Exits(NamedTuple):
    """What became of the grains that left, by their number in the setup."""

    time: Array  # (n,) [s], nan before
    state: Array  # (n, 13) position, velocity, angular velocity, quaternion


class State(NamedTuple):
    """All of it."""

    bodies: Bodies
    spheres: Spheres
    moving: Moving
    exits: Exits
    counts: IntArray  # see the places above
    budget: Array
    # (5,) velocity [m/s] that most grains share, time of the lists [s], and speed of the fastest
    # sphere against the fastest wall at that time [m/s], or more
    drift: Array
    wall_force: Array  # (w, 3) what the grains exerted on each wall in this step [N]


def new_state(setup: Setup, moving: Moving) -> State:
    """State at the start of `setup`."""
    grain, packing = setup.grain, setup.packing
    n, k = len(packing.positions), len(grain.radii)
    scale = np.array(sizes(packing), dtype=np.float64)
    kinematics = np.zeros((n, 16))
    kinematics[:, :3] = packing.positions
    if setup.velocities is not None:
        kinematics[:, 3:6] = setup.velocities
    if setup.angular_velocities is not None:
        kinematics[:, 6:9] = setup.angular_velocities
    quaternion = np.array(packing.orientations, dtype=np.float64)
    quaternion /= np.linalg.norm(quaternion, axis=1, keepdims=True)
    rotation = rotation_matrices(quaternion)
    inertia = np.column_stack(
        [grain.mass * scale**3, np.asarray(grain.inertia) * (scale**5)[:, None]]
    )
    in_body = np.einsum("nij,ni->nj", rotation, kinematics[:, 6:9]) * inertia[:, 1:]
    counts = np.zeros(8, dtype=np.int64)
    counts[GRAINS], counts[STALE] = n, 1
    place = np.zeros((n * k, 4))
    turned = np.einsum("nij,kj->nki", rotation, grain.offsets) * scale[:, None, None]
    place[:, :3] = (packing.positions[:, None] + turned).reshape(-1, 3)
    place[:, 3] = (scale[:, None] * grain.radii).ravel()
    return State(
        Bodies(
            kinematics,
            quaternion,
            rotation.reshape(n, 9).copy(),
            np.einsum("nij,nj->ni", rotation, in_body),
            np.zeros((n, 6)),
            inertia,
            1.0 / inertia,
            scale,
            np.arange(n),
            np.zeros(n, dtype=np.bool_),
        ),
        Spheres(place, np.zeros((n * k, 4)), np.repeat(np.arange(n), k).astype(np.uint32)),
        moving,
        Exits(np.full(n, np.nan), np.zeros((n, 13))),
        counts,
        np.zeros(12),
        np.zeros(5),
        np.zeros((max(1, len(setup.walls)), 3)),
    )


def rotation_matrices(quaternions: Array) -> Array:
    """Rotation matrices (n, 3, 3) of unit quaternions (n, 4) w, x, y, z."""
    w, x, y, z = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.ascontiguousarray(np.moveaxis(np.array(rows), 2, 0))


def new_pairs(capacity: int) -> Pairs:
    """Empty pair list."""
    return Pairs(
        np.zeros(capacity, dtype=np.uint32),
        np.zeros(capacity, dtype=np.uint32),
        np.zeros(BLOCK, dtype=np.uint8),
    )


def new_touching(capacity: int, *, rolling: bool) -> Touching:
    """No contacts."""
    return Touching(
        np.zeros((2, capacity), dtype=np.uint32),
        np.zeros((2, capacity, 3)),
        np.zeros((2, capacity if rolling else 1, 3)),
    )


def new_wall_pairs(entries: int, capacity: int) -> WallPairs:
    """Empty list of spheres at walls."""
    return WallPairs(
        np.zeros(entries, dtype=np.uint32),
        np.zeros(entries + 1, dtype=np.int64),
        np.zeros(capacity, dtype=np.uint32),
        np.zeros(entries, dtype=np.int64),
        np.zeros((entries, WALL_CONTACTS), dtype=np.int64),
        np.zeros((entries, WALL_CONTACTS, HISTORY)),
    )
