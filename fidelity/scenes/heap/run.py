"""The heap scene: a cylinder full of grains on a plate is lifted, and the grains form a heap.

The grains settle in the cylinder; the run starts with its lift at constant speed. Grains that
roll over the edge of the plate leave.

Angle of the heap: its axis goes through the median place of its grains, and its radius R is
twice the median distance of the grains from that axis, which is exact for an even cone (the
share of a cone's volume within r is 3 q^2 - 2 q^3 with q = r/R, one half at q = 1/2) and is not
moved by a few grains that rolled away. The surface height at a distance r is the mean, over
directions, of the top of the highest sphere there, or 0 where none is. The angle is that of
the least-squares line through the surface heights between 0.2 R and 0.8 R: the tip is rounded,
and the foot is a scatter of single grains.
"""

import math
from dataclasses import dataclass

import numpy as np

from fidelity.engine import Grain, Movement, Packing, Setup, Wall, WallMotion
from fidelity.grains.filling import (
    Portion,
    loose_in,
    plane,
    settling_setup,
    strip,
    top_of,
)
from fidelity.grains.portion import sphere_centres, sphere_radii
from fidelity.grains.settings import MILLI
from geometry.mesh import Mesh
from geometry.sections import Section
from mfopt.arrays import Array, frozen
from mfopt.errors import ConfigError

SEGMENTS = 24  # of the cylinder: 0.9 % of its radius from chord to arc
FIT_FROM, FIT_TO = 0.2, 0.8  # [R] between which the line is fitted
PROFILE_TO = 1.2  # [R]
PROFILE_STEP = 0.05  # [R]
LONGEST_LIFT = 60.0  # [s] as long as a rest or the run of another scene may be
DIRECTIONS = 72  # in which the surface height is looked up


@dataclass(frozen=True, slots=True)
class HeapSettings:
    """A cylinder around the z axis on a square plate at z = 0."""

    radius: float  # [m] of the cylinder
    plate: float  # [m] side of the plate
    lift_speed: float  # [m/s]
    lift_height: float  # [m]; more than the grains stand in the cylinder
    rest: float  # [s] from the end of the lift to that of the run


@dataclass(frozen=True, slots=True, eq=False)
class Heap:
    """The heap at the end of the run."""

    angle: float  # [rad] of the fitted line to the horizontal; nan if no grain is left
    radius: float  # [m] twice the median distance of the grains from the axis
    radii: Array  # (m,) [m] distances from the axis
    heights: Array  # (m,) [m] of the surface there
    mean_height: float  # [m] of the mass centres
    fallen: int  # grains that rolled over the edge of the plate


def filling_setup(settings: HeapSettings, portion: Portion, seed: int) -> Setup:
    """Rain the portion into the cylinder that stands on the plate.

    Raises:
        ConfigError: if a setting makes no sense.
        SimulationError: if the grain is too long for the cylinder.
    """
    check_heap(settings)
    section = Section(2 * settings.radius, 2 * settings.radius, settings.radius, 0.0)
    sagitta = settings.radius * (1 - math.cos(math.pi / SEGMENTS))
    loose = loose_in(portion, section, 0.0, seed, chordal_error=sagitta)
    cylinder = _cylinder(settings, portion, top_of(portion, loose))
    return settling_setup(portion, loose, (cylinder, _plate(settings, portion)))


def heap_setup(settings: HeapSettings, portion: Portion, packing: Packing) -> Setup:
    """Lift the cylinder off the settled portion."""
    up_s = settings.lift_height / settings.lift_speed
    motion = WallMotion(
        times=frozen([0.0, up_s]),
        displacements=frozen([[0.0, 0.0, 0.0], [0.0, 0.0, settings.lift_height]]),
    )
    return Setup(
        grain=portion.grain,
        packing=packing,
        grain_material=portion.grain_material,
        walls=(
            _cylinder(settings, portion, top_of(portion, packing), motion),
            _plate(settings, portion),
        ),
        physics=portion.physics,
        duration=up_s + settings.rest,
        exit_z=-portion.grain_length,
    )


def check_heap(settings: HeapSettings) -> None:
    """Refuse settings that make no sense.

    Raises:
        ConfigError: the message names quantity, value, limit and remedy.
    """
    for name, unit in (("radius", "mm"), ("lift_speed", "mm/s"), ("lift_height", "mm")):
        value = getattr(settings, name)
        if not value > 0:
            raise ConfigError(f"{name} = {value / MILLI:g} {unit} must be positive; enlarge it")
    if not settings.plate > 2 * settings.radius:
        raise ConfigError(
            f"plate = {settings.plate / MILLI:g} mm must exceed the cylinder's diameter = "
            f"{2 * settings.radius / MILLI:g} mm; enlarge the plate"
        )
    if not settings.lift_height / settings.lift_speed <= LONGEST_LIFT:
        raise ConfigError(
            f"lift_speed = {settings.lift_speed / MILLI:g} mm/s would take "
            f"{settings.lift_height / settings.lift_speed:.3g} s for lift_height = "
            f"{settings.lift_height / MILLI:g} mm, above the limit of {LONGEST_LIFT:g} s; "
            "lift faster or less high"
        )


def _plate(settings: HeapSettings, portion: Portion) -> Wall:
    return portion.wall("plate", plate_mesh(settings))


def _cylinder(
    settings: HeapSettings, portion: Portion, top: float, motion: WallMotion | None = None
) -> Wall:
    return portion.wall("cylinder", cylinder_mesh(settings, top), motion)


def plate_mesh(settings: HeapSettings) -> Mesh:
    """The plate at z = 0."""
    return plane(settings.plate, settings.plate, 0.0)


def cylinder_mesh(settings: HeapSettings, top: float) -> Mesh:
    """The cylinder from the plate up to the height `top` [m]."""
    angles = np.linspace(0.0, 2 * np.pi, SEGMENTS, endpoint=False)
    circle = settings.radius * np.column_stack([np.cos(angles), np.sin(angles)])
    rings = [np.column_stack([circle, np.full(SEGMENTS, z)]) for z in (0.0, top)]
    triangles = np.array(strip(np.arange(SEGMENTS), np.arange(SEGMENTS, 2 * SEGMENTS)))
    return Mesh(np.vstack(rings), triangles)


def heap_result(grain: Grain, movement: Movement, scales: Array | None = None) -> Heap:
    """Tell from the movement what the heap looks like; `scales` (n,) are the grains' sizes."""
    there = np.isnan(movement.exit_times)
    fallen = int((~there).sum())
    if not there.any():
        return Heap(math.nan, 0.0, frozen([]), frozen([]), 0.0, fallen)
    left = None if scales is None else scales[there]
    packing = Packing(movement.positions[there], movement.orientations[there], left)
    axis = np.median(packing.positions[:, :2], axis=0)
    away = np.linalg.norm(packing.positions[:, :2] - axis, axis=1)
    radius = 2.0 * float(np.median(away))
    radii = radius * np.arange(0.0, PROFILE_TO + PROFILE_STEP / 2, PROFILE_STEP)
    centres = sphere_centres(grain, packing)
    spheres = centres.reshape(-1, 3) - [*axis, 0.0]
    tall = sphere_radii(grain, packing).ravel()
    heights = np.array([surface_height(spheres, tall, float(r)) for r in radii])
    return Heap(
        angle=cone_angle(radii, heights, radius),
        radius=radius,
        radii=frozen(radii),
        heights=frozen(heights),
        mean_height=float(packing.positions[:, 2].mean()),
        fallen=fallen,
    )


def surface_height(centres: Array, radii: Array, distance: float) -> float:
    """Mean height [m] of the tops of spheres (n, 3), (n,) at that distance from the z axis."""
    near = np.abs(np.linalg.norm(centres[:, :2], axis=1) - distance) < radii
    angles = np.linspace(0.0, 2 * np.pi, DIRECTIONS, endpoint=False)
    points = distance * np.column_stack([np.cos(angles), np.sin(angles)])
    gaps = points[:, None] - centres[near, :2]  # (DIRECTIONS, m, 2)
    rise2 = radii[near] ** 2 - np.einsum("ijk,ijk->ij", gaps, gaps)
    tops = np.where(rise2 > 0, centres[near, 2] + np.sqrt(np.maximum(rise2, 0.0)), 0.0)
    return float(tops.max(axis=1, initial=0.0).mean())


def cone_angle(radii: Array, heights: Array, radius: float) -> float:
    """Angle [rad] of the least-squares line through the flank of a profile (m,), (m,) [m]."""
    share = radii / radius
    flank = (share > FIT_FROM - 1e-9) & (share < FIT_TO + 1e-9)
    return math.atan(-float(np.polyfit(radii[flank], heights[flank], 1)[0]))
