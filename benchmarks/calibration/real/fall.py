"""A ball falls through air, from rest, with drag that grows with the speed and with its square."""

import math
from collections.abc import Mapping

import numpy as np
from scipy.integrate import solve_ivp

from mfopt.arrays import Array

G, AIR = 9.81, 1.2  # [m/s2], [kg/m3]


def fall(
    parameters: Mapping[str, float], conditions: Mapping[str, float], seed: int
) -> dict[str, Array]:
    """Height [m] over time.

    Parameters, of which a case has some: `linear` [1/s] and `quadratic` [1/m] drag over the mass;
    or the drag coefficient `drag` of a ball with the conditions diameter [m] and mass [kg].
    Conditions: height of the start [m], duration [s].
    """
    linear = parameters.get("linear", 0.0)
    quadratic = parameters.get("quadratic", 0.0)
    if "drag" in parameters:
        area = math.pi / 4.0 * conditions["diameter"] ** 2
        quadratic = 0.5 * parameters["drag"] * AIR * area / conditions["mass"]
    g = parameters.get("g", G)  # [m/s2]

    def motion(t: float, y: Array) -> tuple[float, float]:
        return -y[1], g - linear * y[1] - quadratic * y[1] ** 2

    times = np.linspace(0.0, conditions["duration"], 201)
    start = (conditions["height"], 0.0)
    done = solve_ivp(motion, (0.0, times[-1]), start, t_eval=times, rtol=1e-8)
    return {"time": times, "height": done.y[0]}
