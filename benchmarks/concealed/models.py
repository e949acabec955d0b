"""Three reduced models: a tank that drains, a ball that falls, a pendulum that swings.

Each has base parameters, effects that a diagnosis knows (its library), and others that lie outside.
A run has a scatter of its own, as real experiments have. `mfopt` calls the functions as a simulator
of the user's own.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from mfopt.arrays import Array

Values = Mapping[str, float]
Ranges = Mapping[str, tuple[float, float]]
G = 9.81  # [m/s2]


@dataclass(frozen=True, slots=True)
class Model:
    """A reduced model and the experiments that are made with it."""

    name: str
    run: Callable[[Values, Values, int], Mapping[str, Array]]
    parameters: Ranges
    effects: Ranges  # from absent to strong
    outside: Ranges  # of effects that no library has
    channels: Mapping[str, tuple[str, float, float]]  # unit, size, measurement noise (1 sd)
    experiments: Mapping[str, Values]  # conditions of each recording
    held_out: str
    rate: float  # [1/s] samples


def tank(parameters: Values, conditions: Values, seed: int) -> dict[str, Array]:
    """Level [m] and drained volume [m3] of a tank over time."""
    get = {**dict.fromkeys((*TANK_EFFECTS, *TANK_OUTSIDE), 0.0), **parameters}.__getitem__
    start, times = conditions["start"], np.linspace(0.0, 40.0, 81)

    def rates(t: float, y: Array) -> list[float]:
        level = max(float(y[0]), 0.0)
        opened = 1.0 - math.exp(-t / get("slow_valve")) if get("slow_valve") > 0.0 else 1.0
        hole = get("coefficient") * 5e-5 * opened * math.exp(-get("clogging") * t)
        speed = math.sqrt(2.0 * G * level) * (1.0 + get("pulsation") * math.sin(0.9 * t))
        flow = hole * speed / (1.0 + get("viscosity") / (1e-3 + level))
        flow += get("leak") * math.sqrt(2.0 * G * max(level - 0.1, 0.0))
        flow += get("late_leak") * (t > 15.0)
        return [-flow / 0.01, flow]

    done = solve_ivp(rates, (0.0, 40.0), [start, 0.0], t_eval=times, rtol=1e-7, atol=1e-9)
    level, volume = done.y
    level = level + get("foam") + get("bulge") * level * (level - 0.3)
    return _scattered(seed, times, {"level": (level, 6e-4), "volume": (volume, 6e-6)})


def ball(parameters: Values, conditions: Values, seed: int) -> dict[str, Array]:
    """Height [m] of a falling ball over time."""
    get = {**dict.fromkeys((*BALL_EFFECTS, *BALL_OUTSIDE), 0.0), **parameters}.__getitem__
    d, m = conditions["diameter"], conditions["mass"]
    area, times = math.pi / 4.0 * d**2, np.linspace(0.0, 2.4, 73)
    quadratic = 0.5 * get("drag_quadratic") * 1.2 * area / m
    lift = get("buoyancy") * 1.2 * math.pi / 6.0 * d**3 / m

    def motion(t: float, y: Array) -> list[float]:
        wind = get("updraft") * (y[0] < 15.0)
        speed = y[1] - wind
        crisis = 1.0 - get("drag_crisis") * (abs(speed) > 14.0)
        air = get("drag_linear") * d / m * speed + quadratic * crisis * abs(speed) * speed
        return [float(y[1]), -G * (1.0 - lift) - air + get("string") * max(0.0, 1.0 - t) / m]

    start = [30.0, -get("push")]
    done = solve_ivp(motion, (0.0, 2.4), start, t_eval=times, rtol=1e-7)
    return _scattered(seed, times, {"height": (done.y[0], 0.02)})


def pendulum(parameters: Values, conditions: Values, seed: int) -> dict[str, Array]:
    """Angle [rad] of a pendulum over time."""
    get = {**dict.fromkeys((*PENDULUM_EFFECTS, *PENDULUM_OUTSIDE), 0.0), **parameters}.__getitem__
    times = np.linspace(0.0, 6.0, 121)

    def motion(t: float, y: Array) -> list[float]:
        friction = get("viscous") * y[1] + get("dry") * math.tanh(y[1] / 0.02)
        friction += get("quadratic") * abs(y[1]) * y[1]
        friction += get("worn_bearing") * math.tanh(y[1] / 0.02) * (y[0] > 0.0)
        wind = get("draught") * math.sin(2.1 * t)
        stiff = get("spring") * y[0] + get("magnet") * math.exp(-((y[0] / 0.1) ** 2)) * y[0]
        return [float(y[1]), -(get("frequency") ** 2) * math.sin(y[0]) - friction - stiff + wind]

    start = [conditions["angle"], 0.0]
    done = solve_ivp(motion, (0.0, 6.0), start, "LSODA", times, rtol=1e-7, atol=1e-8)
    return _scattered(seed, times, {"angle": (done.y[0], 0.003)})


def _scattered(
    seed: int, times: Array, series: Mapping[str, tuple[Array, float]]
) -> dict[str, Array]:
    """Series with slow waves of a run's own; the numbers are amplitudes."""
    rng, phase = np.random.default_rng(seed), times / times[-1]
    made = {"time": times}
    for name, (values, size) in series.items():
        waves = [rng.normal() * np.sin((k + 1) * math.pi * phase / 2.0) / (k + 1) for k in range(3)]
        made[name] = values + size * np.sum(waves, axis=0)
    return made


TANK_EFFECTS: Ranges = {
    "leak": (0.0, 1.5e-5), "slow_valve": (0.0, 4.0), "clogging": (0.0, 0.02),
    "foam": (0.0, 0.01), "viscosity": (0.0, 0.05),
}  # fmt: skip
TANK_OUTSIDE: Ranges = {"pulsation": (0.0, 0.4), "late_leak": (0.0, 1.5e-5), "bulge": (0.0, 0.5)}
BALL_EFFECTS: Ranges = {
    "drag_quadratic": (0.0, 1.2), "drag_linear": (0.0, 0.3), "buoyancy": (0.0, 20.0)
}  # fmt: skip
BALL_OUTSIDE: Ranges = {"updraft": (0.0, 8.0), "drag_crisis": (0.0, 0.9), "string": (0.0, 0.3)}
PENDULUM_EFFECTS: Ranges = {
    "viscous": (0.0, 0.3), "dry": (0.0, 0.5), "quadratic": (0.0, 0.3), "spring": (0.0, 1.5)
}  # fmt: skip
PENDULUM_OUTSIDE: Ranges = {
    "worn_bearing": (0.0, 0.6), "draught": (0.0, 0.6), "magnet": (0.0, 8.0)
}  # fmt: skip
MODELS = (
    Model(
        "tank", tank, {"coefficient": (0.5, 0.8)}, TANK_EFFECTS, TANK_OUTSIDE,
        {"level": ("m", 0.4, 6e-4), "volume": ("m3", 0.004, 6e-6)},
        {"full": {"start": 0.4}, "half": {"start": 0.2}, "three quarters": {"start": 0.3}},
        "three quarters", 2.0,
    ),
    Model(
        "ball", ball, {"push": (-0.5, 0.5)}, BALL_EFFECTS, BALL_OUTSIDE,
        {"height": ("m", 30.0, 0.03)},
        {
            "light": {"diameter": 0.07, "mass": 0.03}, "heavy": {"diameter": 0.1, "mass": 0.5},
            "large": {"diameter": 0.2, "mass": 0.4}, "tennis": {"diameter": 0.067, "mass": 0.058},
        },
        "tennis", 30.0,
    ),
    Model(
        "pendulum", pendulum, {"frequency": (4.2, 4.8)}, PENDULUM_EFFECTS, PENDULUM_OUTSIDE,
        {"angle": ("rad", 1.0, 0.004)},
        {"wide": {"angle": 1.0}, "narrow": {"angle": 0.25}, "middle": {"angle": 0.6}},
        "middle", 25.0,
    ),
)  # fmt: skip
