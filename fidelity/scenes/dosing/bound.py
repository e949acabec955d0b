"""A physical lower bound of the filling time: free fall through an opening hole.

Grains start at rest and nothing holds them back. A grain at the opening then moves downwards
with at most

    u(t) = min(g (t - t_0), sqrt(2 g h)),

t_0 being when hole and cup first overlap and h the height of the cup, so that the opened area
A(t), taken without its rounded corners, lets at most the volume A u dt of the bulk through. The
last grain cannot leave before t_1, when that has added up to the volume of the cup. From the
plate to the tube's end, H below, a grain of downward speed u takes

    s(u) = (sqrt(u^2 + 2 g H) - u) / g,

and so between the first and the last grain there are at least T = t_1 + s(u(t_1)) - t_0 - s(0).
A hole that opens at once gives T = sqrt(2 (H + h) / g) - sqrt(2 H / g): the column falls whole.

Friction, walls and the queue before the tube only add to it, as long as they do not hold back
the first grain. The bound over all motions takes the largest speed of the cup that the bounds
allow, until the hole is open; other values stay as in the settings.
"""

import itertools
import math

import numpy as np

from fidelity.grains.settings import GRAVITY, MILLI
from fidelity.scenes.dosing.design import Design, dosing_cup
from fidelity.scenes.dosing.settings import MOTION_PARAMETERS, DosingSettings
from geometry.motion import MotionLaw
from geometry.parts import Cup
from geometry.sections import Section
from mfopt.arrays import Array

TIME_STEPS = 2400  # of the cycle; 0.25 ms of 600 ms
SPEED_GRID = 5  # values of x1 and of x2 for the largest speed
SPEED_TIMES = 401  # at which the speed is taken


def emptying_spread(times: Array, areas: Array, cup: Cup, depth: float) -> float:
    """Least time between the first and the last grain at the tube's end [s].

    Args:
        times: evenly spaced, from the start of the motion (m,) [s].
        areas: opened area at these times (m,) [m2].
        cup: the cup, full.
        depth: of the tube's end below the plate [m].

    Returns:
        The spread; infinite if the opening cannot let the whole cup through.
    """
    if not (areas > 0).any():
        return math.inf
    first = float(times[np.argmax(areas > 0)])
    since = np.maximum(times - first, 0.0)
    speeds = np.minimum(GRAVITY * since, math.sqrt(2 * GRAVITY * cup.height))
    through = np.cumsum(areas * speeds) * (times[1] - times[0])
    if through[-1] < cup.volume:
        return math.inf
    last = int(np.argmax(through >= cup.volume))
    return float(times[last] + _fall(float(speeds[last]), depth) - first - _fall(0.0, depth))


def _fall(speed: float, depth: float) -> float:
    return (math.sqrt(speed**2 + 2 * GRAVITY * depth) - speed) / GRAVITY


def opened_area(positions: Array, cup: Section, hole: Section) -> Array:
    """Area of the hole that lies beneath the cup (m,) [m2], corners taken as square.

    Args:
        positions: of the cup's centre along x (m,) [m].
        cup: section of the cup.
        hole: section of the hole.
    """
    reach = (cup.length + hole.length) / 2 - np.abs(positions - hole.shift)
    length = np.clip(reach, 0.0, min(cup.length, hole.length))
    return np.asarray(length * min(cup.width, hole.width))


def filling_time_bound(machine: Design) -> float:
    """Lower bound of the filling time for the motion and the hole of this design [s]."""
    times = np.linspace(0.0, machine.cycle, TIME_STEPS + 1)
    areas = opened_area(machine.cup_position(times), machine.cup.section, machine.hole)
    return emptying_spread(times, areas, machine.cup, -machine.tube_end_z)


def smallest_filling_time_bound(settings: DosingSettings) -> float:
    """Smallest bound over all motions within the bounds of the free motion parameters [s].

    The opened length grows at most as fast as the cup can move. If the hole's length, width or
    shift is free, it is taken as at least as large as the cup and open at once.
    """
    cup = dosing_cup(settings)
    section = cup.section
    times = np.linspace(0.0, MILLI * settings.cycle_ms, TIME_STEPS + 1)
    if {"l0", "w0", "s0"} & set(settings.free):
        areas = np.full(times.shape, section.length * section.width)
    else:
        values = settings.all_values()
        hole = Section(*(MILLI * values[f"{letter}0"] for letter in "lwrs"))
        speed = largest_speed(settings) * settings.stroke_mm / settings.cycle_ms  # mm/ms = m/s
        touching = -(section.length + hole.length) / 2
        positions = np.minimum(hole.shift + touching + speed * times, hole.shift)
        areas = opened_area(positions, section, hole)
    return emptying_spread(times, areas, cup, -MILLI * settings.tube_end_z_mm)


def largest_speed(settings: DosingSettings) -> float:
    """Largest speed of the cup over all motions within the bounds [strokes per cycle].

    For given x1 and x2 the velocity at any time is linear in y1, y2 and v, so its largest
    value lies at a corner of their bounds; x1 and x2 are taken on a grid with its ends.
    """
    values = settings.all_values()
    choices = []
    for name in MOTION_PARAMETERS:
        low, high = settings.free.get(name, (values[name], values[name]))
        choices.append(np.unique(np.linspace(low, high, SPEED_GRID if name[0] == "x" else 2)))
    times = np.linspace(0.0, 1.0, SPEED_TIMES)
    largest = 0.0
    for x1, y1, x2, y2, v in itertools.product(*choices):
        if 0 < x1 < x2 < 1:
            velocity = MotionLaw(*map(float, (x1, y1, x2, y2, v))).velocity(times)
            largest = max(largest, float(np.abs(velocity).max()))
    return largest
