"""A ball falls through air: a simulator of the user's own, in ten lines."""

import math

import numpy as np
from scipy.integrate import solve_ivp

G, AIR = 9.81, 1.2  # [m/s2], [kg/m3]


def fall(parameters, conditions, seed):
    """Height [m] over time. Parameter: drag coefficient; conditions: diameter [m], mass [kg]."""
    area = math.pi / 4.0 * conditions["diameter"] ** 2
    rate = 0.5 * parameters["drag"] * AIR * area / conditions["mass"]  # [1/m]
    times = np.linspace(0.0, 1.2, 61)
    done = solve_ivp(
        lambda t, y: (-y[1], G - rate * y[1] ** 2), (0.0, 1.2), (10.0, 0.0), t_eval=times, rtol=1e-8
    )
    return {"time": times, "height": done.y[0]}
