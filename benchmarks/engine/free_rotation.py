"""Free rotation of a body with three moments of inertia, near its unstable axis.

Euler's equations, integrated to 1e-11, tell where its axes are; they have no simple closed form.
"""

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.engine.small_scenes import LEVEL, LIMIT_S, Start, asymmetric, finished, scene, still
from fidelity.engines.numba import NumbaEngine
from mfopt.arrays import Array

SPIN = np.array([0.2, 30.0, 0.1])  # [rad/s] in the body, about its middle axis
DURATION = 1.0  # [s]


def rates(inertia: Array, y: Array) -> Array:
    """Rates of the angular velocity in the body and of the orientation, a quaternion."""
    spin, w, v = y[:3], y[3], y[4:]
    turning = np.cross(inertia * spin, spin) / inertia
    return np.concatenate([turning, [-0.5 * v @ spin], 0.5 * (w * spin + np.cross(v, spin))])


def middle_axis(quaternions: Array) -> Array:
    """The body's y axis in space (n, 3)."""
    w, x, y, z = quaternions.T
    return np.column_stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)])


def tumbling(step: float) -> tuple[Array, Array, Array]:
    """Times (n,) [s], and the middle axis (n, 3) by the engine and by Euler's equations."""
    body = asymmetric()
    times = np.linspace(0.0, DURATION, 120)
    setup = scene(
        body,
        [Start((0.0, 0.0, 0.0), LEVEL, spin=SPIN)],
        physics=still(),
        duration=DURATION,
        snapshots=times,
    )
    movement = finished(NumbaEngine(fixed_timestep=step).move(setup, time_limit_s=LIMIT_S))
    at = movement.snapshots["snapshot_times"]
    exact = solve_ivp(
        lambda t, y: rates(body.inertia, y),
        (0.0, float(at[-1])),
        np.concatenate([SPIN, LEVEL]),
        method="DOP853",
        t_eval=at,
        rtol=1e-11,
        atol=1e-11,
    )
    engine = movement.snapshots["snapshot_orientations"][:, 0]
    return at, middle_axis(engine), middle_axis(exact.y[3:].T)


def axis_error(step: float) -> float:
    """Largest error of the middle axis within the time."""
    _, engine, exact = tumbling(step)
    return float(np.linalg.norm(engine - exact, axis=1).max())
