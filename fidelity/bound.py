"""A physical lower bound of the filling time: free fall through an opening hole.

Without any contact a column of grains at place xi in the cup (measured from its centre) falls
freely as soon as the hole opens beneath it, at t_o(xi). A grain at height eta above the plate
passes the tube's end, H below the plate, at

    t = t_o(xi) + sqrt(2 (H + eta) / g),    0 <= eta <= h (height of the cup),

so that between the first and the last grain there are at least

    T = max t_o - min t_o + sqrt(2 (H + h) / g) - sqrt(2 H / g).

Contacts only hold grains back: friction, walls and the queue before the tube are left out, and
the cup's tallest column is taken to be as high as the cup. The bound over all motions takes
the largest speed of the cup that the bounds allow; other values stay as in the settings.
"""

import itertools
import math

import numpy as np

from fidelity.dosing import MILLI, Design, dosing_cup
from fidelity.dosing_run import GRAVITY
from fidelity.settings import MOTION_PARAMETERS, DosingSettings
from geometry.motion import MotionLaw
from geometry.sections import Section
from mfopt.arrays import Array

TIME_STEPS = 2400  # of the cycle; 0.25 ms of 600 ms
COLUMNS = 101  # along the cup
SPEED_GRID = 5  # values of x1 and of x2 for the largest speed
SPEED_TIMES = 401  # at which the speed is taken


def falling_spread(depth: float, height: float) -> float:
    """Time between the lowest and the highest grain of a freely falling column [s].

    Args:
        depth: of the tube's end below the plate [m].
        height: of the column [m].
    """
    return math.sqrt(2 * (depth + height) / GRAVITY) - math.sqrt(2 * depth / GRAVITY)


def opening_time(positions: Array, times: Array, cup: Section, hole: Section) -> float:
    """Time from the first to the last column of the cup that the hole opens beneath [s].

    Columns that never come over the hole are left out: their grains stay in the cup.

    Args:
        positions: of the cup's centre along x (m,) [m].
        times: of the positions (m,) [s].
        cup: section of the cup.
        hole: section of the hole.
    """
    columns = np.linspace(-0.5, 0.5, COLUMNS) * cup.length
    place = positions[:, None] + columns - hole.shift
    is_open = np.abs(place) <= hole.length / 2
    ever = is_open.any(axis=0)
    if not ever.any():
        return 0.0
    opened = times[is_open.argmax(axis=0)[ever]]
    return float(opened.max() - opened.min())


def filling_time_bound(machine: Design) -> float:
    """Lower bound of the filling time for the motion and the hole of this design [s]."""
    times = np.linspace(0.0, machine.cycle, TIME_STEPS + 1)
    opening = opening_time(machine.cup_position(times), times, machine.cup.section, machine.hole)
    return opening + falling_spread(-machine.tube_end_z, machine.cup.height)


def smallest_filling_time_bound(settings: DosingSettings) -> float:
    """Smallest bound over all motions within the bounds of the free motion parameters [s].

    From the first column to the last the cup has to travel its length, at the largest speed
    that the bounds allow. If the hole's length or shift is free, it is taken to open at once.
    """
    cup, z = dosing_cup(settings), MILLI * settings.tube_end_z_mm
    values = settings.all_values()
    travel = 0.0
    if not {"l0", "s0"} & set(settings.free):
        edge = MILLI * (values["s0"] - values["l0"] / 2 - settings.stroke_mm * -0.5)
        travel = min(max(edge + cup.section.length / 2, 0.0), cup.section.length)
    speed = largest_speed(settings) * settings.stroke_mm / settings.cycle_ms  # mm/ms = m/s
    return travel / speed + falling_spread(-z, cup.height)


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
