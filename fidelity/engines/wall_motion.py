"""Where a prescribed motion puts a wall, and how fast it moves."""

import numpy as np

from fidelity.engine import Setup, WallMotion
from mfopt.arrays import Array


def shift_at(motion: WallMotion, points: Array, time: float) -> Array:
    """How far the wall's points (n, 3) [m] of time 0 have moved at `time` [s]: (n, 3) [m]."""
    moved = [np.interp(time, motion.times, along) for along in motion.displacements.T]
    shift = np.tile(moved, (len(points), 1))
    if motion.angles is None:
        return shift
    from_pivot = points - np.asarray(motion.pivot)
    turned = from_pivot @ rotation(motion.axis, angle_at(motion, time)).T
    return np.asarray(shift + (turned - from_pivot))


def angle_at(motion: WallMotion, time: float) -> float:
    """Angle [rad] about the motion's axis at `time` [s]."""
    return 0.0 if motion.angles is None else float(np.interp(time, motion.times, motion.angles))


def rotation(axis: tuple[float, float, float], angle: float) -> Array:
    """Matrix (3, 3) that turns by `angle` [rad] about the unit vector `axis` (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross)


def top_speed(motion: WallMotion | None, vertices: Array) -> float:
    """Speed [m/s] that no point of the wall exceeds; its vertices (v, 3) [m] at time 0."""
    if motion is None or motion.times.size < 2:
        return 0.0
    spans = np.diff(motion.times)
    speeds = np.linalg.norm(np.diff(motion.displacements, axis=0), axis=1) / spans
    if motion.angles is not None:
        arms = np.cross(vertices - np.asarray(motion.pivot), np.asarray(motion.axis))
        reach = float(np.max(np.linalg.norm(arms, axis=1)))  # from the axis [m]
        speeds = speeds + reach * np.abs(np.diff(motion.angles)) / spans
    return float(np.max(speeds))


def given_speed(setup: Setup) -> float:
    """Largest speed [m/s] that the setup gives a wall, or a grain at the start."""
    fastest = [top_speed(wall.motion, wall.vertices) for wall in setup.walls]
    if setup.velocities is not None:
        fastest.append(float(np.max(np.linalg.norm(setup.velocities, axis=1))))
    return max(fastest, default=0.0)
