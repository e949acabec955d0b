"""A tank drains through a hole: a simulator of the user's own that can switch effects on."""

import numpy as np
from scipy.integrate import solve_ivp

G = 9.81  # [m/s2]
TANK, HOLE = 0.01, 5e-5  # areas [m2]


def drain(parameters, conditions, seed):
    """Level [m] and drained volume [m3] over time; effects that are left out are absent."""
    coefficient = parameters["coefficient"]
    leak = parameters.get("leak", 0.0)  # [m2] area of a second hole, 0.1 m above the bottom
    slow_valve = parameters.get("slow_valve", 0.0)  # [s] time until the hole is open
    clogging = parameters.get("clogging", 0.0)  # [1/s] share of the hole that closes
    foam = parameters.get("foam", 0.0)  # [m] thickness of foam on top, which the camera sees
    start, times = conditions["start"], np.linspace(0.0, 40.0, 161)

    def rates(t, y):
        level = max(y[0], 0.0)
        opened = 1.0 - np.exp(-t / slow_valve) if slow_valve > 0.0 else 1.0
        hole = coefficient * HOLE * opened * np.exp(-clogging * t)
        flow = hole * np.sqrt(2.0 * G * level)
        flow += leak * np.sqrt(2.0 * G * max(level - 0.1, 0.0))
        return [-flow / TANK, flow]

    done = solve_ivp(rates, (0.0, 40.0), [start, 0.0], t_eval=times, rtol=1e-8, atol=1e-10)
    level, volume = done.y
    return {"time": times, "level": level + foam, "volume": volume}
