"""The silo scene: a slender box filled with grains, and how much of their weight its sides carry.

Filling and rest are one run of fixed length, so that the walls' friction is that of the filling:
a run that started from a settled packing would have to build it up again. Forces are averaged
over the last part of the run. The share grows with slenderness, friction of the wall and the
ratio of horizontal to vertical stress: Janssen (1895), translated in arXiv:cond-mat/0511618.
"""

from dataclasses import dataclass

import numpy as np

from fidelity.engine import Movement, Setup, Wall
from fidelity.grains.filling import (
    Portion,
    filling_physics,
    filling_time,
    loose_in,
    plane,
    rectangle,
    strip,
    top_of,
)
from fidelity.grains.settings import MILLI
from geometry.mesh import Mesh
from geometry.sections import Section
from mfopt.arrays import Array, frozen
from mfopt.errors import ConfigError

AVERAGED = 0.1  # [s] at the end of the run
SNAPSHOTS = 11  # in that time
WALL_FORCES = "snapshot_wall_forces"
FLOOR = "floor"  # all other walls are sides


@dataclass(frozen=True, slots=True)
class SiloSettings:
    """A box of square section on a floor at z = 0."""

    width: float  # [m]
    rest: float = 0.1  # [s] after the time in which the grains come to rest


@dataclass(frozen=True, slots=True, eq=False)
class SiloLoad:
    """Forces of the grains at rest on side walls and floor, over the weight of the grains."""

    wall_share: float  # [-] carried by the side walls
    floor_share: float  # [-] carried by the floor; both together are 1 at rest
    shares: Array  # (s,) of the side walls, at the moments averaged over
    fill_height: float  # [m] twice the mean height of the mass centres


def check_silo(settings: SiloSettings) -> None:
    """Refuse a silo that cannot be built.

    Raises:
        ConfigError: the message names quantity, value, limit and remedy.
    """
    if not settings.width > 0:
        raise ConfigError(f"width = {settings.width / MILLI:g} mm must be positive; enlarge it")


def silo_setup(settings: SiloSettings, portion: Portion, seed: int) -> Setup:
    """Rain the portion into the silo and let it rest there.

    Raises:
        ConfigError: if the silo cannot be built.
        SimulationError: if the grain is too long for it.
    """
    check_silo(settings)
    width = settings.width
    loose = loose_in(portion, Section(width, width, 0.0, 0.0), 0.0, seed)
    top = top_of(portion, loose)
    duration = filling_time(portion, top) + settings.rest
    return Setup(
        grain=portion.grain,
        packing=loose,
        grain_material=portion.grain_material,
        walls=(
            _sides(portion, width, top),
            portion.wall(FLOOR, plane(width, width, 0.0)),
        ),
        physics=filling_physics(portion),
        duration=duration,
        exit_z=-portion.grain_length,
        # The last a little before the end: an engine looks at the grains every now and then.
        snapshot_times=frozen(
            np.linspace(duration - 1.1 * AVERAGED, duration - 0.1 * AVERAGED, SNAPSHOTS)
        ),
    )


def _sides(portion: Portion, width: float, top: float) -> Wall:
    corners = np.array(rectangle(width, width, 0.0) + rectangle(width, width, top))
    triangles = np.array(strip(np.arange(4), np.arange(4, 8)))
    return portion.wall("sides", Mesh(corners, triangles))


def silo_load(setup: Setup, movement: Movement) -> SiloLoad:
    """Tell from the movement what side walls and floor carry.

    Raises:
        ConfigError: if the engine keeps no forces on walls.
    """
    forces = movement.snapshots.get(WALL_FORCES)
    if forces is None:
        raise ConfigError(
            f"the engine keeps no forces on walls; choose one that gives {WALL_FORCES}"
        )
    weight = len(movement.positions) * setup.grain.mass * setup.physics.gravity
    down = -forces[:, :, 2] / weight  # (s, w)
    floor = np.array([wall.name == FLOOR for wall in setup.walls])
    on_sides, on_floor = down[:, ~floor].sum(axis=1), down[:, floor].sum(axis=1)
    return SiloLoad(
        wall_share=float(on_sides.mean()),
        floor_share=float(on_floor.mean()),
        shares=frozen(on_sides),
        fill_height=2.0 * float(movement.positions[:, 2].mean()),
    )
