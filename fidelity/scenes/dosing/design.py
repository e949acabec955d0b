"""The dosing problem: design variables, and the hopper, cup and motion that a design means.

A cup stands above the plate (z = 0), moves along x from half a stroke before the hole's
reference line to half a stroke behind it, and empties through hopper and tube.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from fidelity.grains.settings import MILLI
from fidelity.scene import Possible
from fidelity.scenes.dosing.settings import MOTION_PARAMETERS, SIMPLE_MOTIONS, DosingSettings
from geometry.loft import Loft, check_loft
from geometry.mesh import Mesh
from geometry.motion import MotionLaw
from geometry.parts import Cup, cup_wall, passage, plate_with_hole
from geometry.sections import Section, check_section
from mfopt.arrays import Array, frozen
from mfopt.errors import ConfigError, InvalidDesign
from mfopt.records.problem import Problem, Variable

MICRO = 1e-6  # ml to m3
VIEWING_CHORDAL_ERROR = 2e-4  # [m] not to be seen in a picture of the machine
MOTION_STEP = 1e-3  # [s] a tenth of a millimetre of error at 800 m/s2
PLATE_MARGIN = 0.05  # [m] plate around everything that the cup ever covers


@dataclass(frozen=True, slots=True, eq=False)
class Design:
    """One design of the dosing machine, SI units."""

    loft: Loft  # hole, two sections, tube
    motion: MotionLaw  # normalised
    cup: Cup
    tube_end_z: float  # [m]
    stroke: float  # [m]
    cycle: float  # [s]

    @property
    def hole(self) -> Section:
        """The hole in the plate."""
        return self.loft.sections[0]

    def cup_position(self, times: Array) -> Array:
        """Place of the cup's centre along x [m] at `times` [s]; it rests after the cycle."""
        t = np.clip(np.asarray(times) / self.cycle, 0.0, 1.0)
        return np.asarray(self.stroke * (self.motion.position(t) - 0.5))

    def cup_velocity(self, times: Array) -> Array:
        """Velocity of the cup along x [m/s] at `times` [s] within the cycle."""
        t = np.clip(np.asarray(times) / self.cycle, 0.0, 1.0)
        return np.asarray(self.stroke / self.cycle * self.motion.velocity(t))


@dataclass(frozen=True, slots=True, eq=False)
class CupMotion:
    """The cup's motion over one cycle, sampled."""

    times: Array  # (m,) [s]
    positions: Array  # (m,) [m] of the cup's centre along x; 0 at the hole's reference line
    velocities: Array  # (m,) [m/s]


def dosing_problem(settings: DosingSettings) -> Problem:
    """The free parameters as variables, in their order in the settings; the baseline design.

    Raises:
        ConfigError: if the baseline cannot be built, or lies outside the bounds.
    """
    try:
        dosing_cup(settings)
    except InvalidDesign as error:
        raise ConfigError(f"the cup cannot be built: {error}; change its size") from error
    values = settings.all_values()
    variables = tuple(
        Variable(name, low, high, "-" if name in MOTION_PARAMETERS else "mm")
        for name, (low, high) in settings.free.items()
    )
    baseline = frozen([values[v.name] for v in variables])
    return Problem(variables, baseline, Possible(settings, design), objective_unit="s")


def starting_designs(problem: Problem) -> dict[str, Array]:
    """The baseline and the simple motions over its hopper, by name, in the units of the problem.

    A motion changes what is free of it; one that leaves the bounds or cannot be built is left out.
    """
    found = {"baseline": problem.baseline}
    for name, motion in SIMPLE_MOTIONS.items():
        its = {**problem.named(problem.baseline)}
        its |= {k: v for k, v in zip(MOTION_PARAMETERS, motion, strict=True) if k in its}
        x = frozen([its[k] for k in problem.names])
        inside = bool(((x >= problem.lower) & (x <= problem.upper)).all())
        known = any(np.array_equal(x, other) for other in found.values())
        if inside and not known and problem.impossible(x) is None:
            found[name] = x
    return found


def design(settings: DosingSettings, x: Array) -> Design:
    """The machine that the free parameters `x` (d,) describe, in mm and -, as in the problem.

    Raises:
        InvalidDesign: if it cannot be built.
    """
    free = dict(zip(settings.free, map(float, x), strict=True))
    values = {**settings.all_values(), **free, "z0": 0.0}
    heights = frozen([MILLI * values[f"z{i}"] for i in range(4)])
    loft = Loft(heights, tuple(_section(values, i) for i in range(4)))
    check_loft(loft)
    tube_end_z = MILLI * settings.tube_end_z_mm
    if tube_end_z >= heights[3]:
        raise InvalidDesign(
            f"tube end z = {settings.tube_end_z_mm:g} mm must lie below the tube's upper end "
            f"z3 = {values['z3']:g} mm"
        )
    return Design(
        loft=loft,
        motion=MotionLaw(*(values[name] for name in MOTION_PARAMETERS)),
        cup=dosing_cup(settings),
        tube_end_z=tube_end_z,
        stroke=MILLI * settings.stroke_mm,
        cycle=MILLI * settings.cycle_ms,
    )


def _section(values: Mapping[str, float], i: int) -> Section:
    return Section(*(MILLI * values[f"{letter}{i}"] for letter in "lwrs"))


def dosing_cup(settings: DosingSettings) -> Cup:
    """The cup, centred at x = 0.

    Raises:
        InvalidDesign: if its corner radius is too large.
    """
    c = settings.cup
    section = Section(MILLI * c.length_mm, MILLI * c.width_mm, MILLI * c.radius_mm, 0.0)
    check_section(section, "cup")
    return Cup(section, MICRO * c.volume_ml)


def cup_motion(settings: DosingSettings, x: Array) -> CupMotion:
    """The cup's motion over the cycle, sampled every `MOTION_STEP`."""
    machine = design(settings, x)
    times = np.linspace(0.0, machine.cycle, round(machine.cycle / MOTION_STEP) + 1)
    return CupMotion(
        frozen(times), frozen(machine.cup_position(times)), frozen(machine.cup_velocity(times))
    )


def plate(machine: Design, chordal_error: float) -> Mesh:
    """The plate with its hole, large enough for the whole travel of the cup."""
    low, high = machine.motion.range()
    travel = machine.stroke * max(abs(low - 0.5), abs(high - 0.5))
    section, hole = machine.cup.section, machine.hole
    half_length = max(travel + section.length / 2, hole.length / 2 + abs(hole.shift))
    return plate_with_hole(
        hole,
        2 * (half_length + PLATE_MARGIN),
        max(section.width, hole.width) + 2 * PLATE_MARGIN,
        chordal_error,
    )


def design_parts(settings: DosingSettings, x: Array) -> dict[str, Mesh]:
    """Meshes of cup (at its start), plate, hopper and tube for viewing."""
    machine = design(settings, x)
    cup = cup_wall(machine.cup, VIEWING_CHORDAL_ERROR)
    start = float(machine.cup_position(np.zeros(1))[0])
    whole = passage(machine.loft, machine.tube_end_z, VIEWING_CHORDAL_ERROR)
    centres = whole.vertices[whole.triangles].mean(axis=1)
    in_tube = centres[:, 2] < machine.loft.heights[3]
    return {
        "cup": Mesh(cup.vertices + np.array([start, 0.0, 0.0]), cup.triangles),
        "plate": plate(machine, VIEWING_CHORDAL_ERROR),
        "hopper": Mesh(whole.vertices, whole.triangles[~in_tube]),
        "tube": Mesh(whole.vertices, whole.triangles[in_tube]),
    }
