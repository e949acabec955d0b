"""A ball falls through air with drag that grows with its speed and with the square of it."""

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

    Parameters, of which a case has some: `linear` [1/s] and `quadratic` [1/m] drag over the mass,
    the same for each ball; `speed` [m/s] downwards at the start; `g` [m/s2]. Of balls with the
    conditions diameter [m] and mass [kg] also the drag coefficient `drag`, viscous drag `viscous`
    [kg/(m s)] over diameter and speed, and `buoyancy` over the weight of the displaced air.
    Conditions: height of the start [m], duration [s].
    """
    get = {"g": G, **parameters}.get
    d, m = conditions.get("diameter", 0.0), conditions.get("mass", 1.0)
    linear = get("linear", 0.0) + get("viscous", 0.0) * d / m
    quadratic = get("quadratic", 0.0) + 0.5 * get("drag", 0.0) * AIR * math.pi / 4.0 * d**2 / m
    lift = get("buoyancy", 0.0) * AIR * math.pi / 6.0 * d**3 / m
    g = get("g", G) * (1.0 - lift)

    def motion(t: float, y: Array) -> tuple[float, float]:
        return -y[1], g - linear * y[1] - quadratic * abs(y[1]) * y[1]

    times = np.linspace(0.0, conditions["duration"], 201)
    start = (conditions["height"], get("speed", 0.0))
    done = solve_ivp(motion, (0.0, times[-1]), start, t_eval=times, rtol=1e-8)
    return {"time": times, "height": done.y[0]}
