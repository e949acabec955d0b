"""Portions and movements that the tests of the scenes share."""

import math

import numpy as np

from fidelity.engine import Material, Movement, Physics
from fidelity.grains.filling import Portion
from fidelity.grains.grain import line_grain
from mfopt.arrays import Array

GRAIN_MATERIAL = Material(1e6, 0.2, math.atan(0.6), 1500.0)
WALL_MATERIAL = Material(1e8, 0.3, math.atan(0.4), 7800.0)


def portion_of(grains: int, *, length: float = 0.035, width: float = 0.01) -> Portion:
    """Grains of 5 spheres."""
    grain = line_grain(length, width, 5, GRAIN_MATERIAL.density)
    return Portion(grain, grains, GRAIN_MATERIAL, WALL_MATERIAL, Physics(damping=0.125))


def movement_to(
    positions: Array,
    *,
    exit_times: Array | None = None,
    snapshots: dict[str, Array] | None = None,
) -> Movement:
    """A finished movement of upright grains that ended there; made up, for known answers."""
    n = len(positions)
    upright = np.tile([math.sqrt(0.5), 0.0, -math.sqrt(0.5), 0.0], (n, 1))
    return Movement(
        status="finished",
        why=None,
        exit_times=np.full(n, np.nan) if exit_times is None else exit_times,
        positions=positions,
        orientations=upright,
        velocities=np.zeros((n, 3)),
        angular_velocities=np.zeros((n, 3)),
        end_time=1.0,
        steps=1,
        sphere_steps=1.0,
        timestep=1e-4,
        max_overlap=0.0,
        max_kinetic_energy=0.0,
        cpu_s=0.0,
        snapshots={} if snapshots is None else snapshots,
    )
