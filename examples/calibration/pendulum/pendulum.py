"""A pendulum swings freely: a simulator of the user's own, in ten lines."""

import math

import numpy as np
from scipy.integrate import solve_ivp


def swing(parameters, conditions, seed):
    """Angle [rad] from rest position over time.

    Parameters: natural frequency [rad/s], viscous damping [1/s], dry friction [rad/s2], and drag
    with the square of the rate, each over the moment of inertia; those that are known may be
    conditions. Conditions: angle [rad] and rate [rad/s] at the start, duration [s].
    """
    its = {"quadratic": 0.0} | parameters | conditions
    w, viscous, dry, drag = (its[k] for k in ("frequency", "viscous", "dry", "quadratic"))
    slow = 0.02  # [rad/s] below which dry friction fades, so that it has no jump

    def motion(t, y):
        friction = viscous * y[1] + dry * math.tanh(y[1] / slow) + drag * abs(y[1]) * y[1]
        return y[1], -(w**2) * math.sin(y[0]) - friction

    times = np.linspace(0.0, conditions["duration"], 501)
    start = (conditions["angle"], conditions["rate"])
    done = solve_ivp(motion, (0.0, times[-1]), start, "LSODA", times, rtol=1e-6, atol=1e-7)
    return {"time": times, "angle": done.y[0]}
