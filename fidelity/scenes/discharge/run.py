"""The discharge scene: a filled hopper with a slot or a hole, and what leaves it over time.

The grains settle on a gate that closes the outlet at z = 0. The run starts with the gate gone:
time counts from there. A grain has passed when its mass centre is `fall` below the outlet.
The floor is flat, or leads down to the outlet as a wedge (a pyramid where the outlet is
narrower than the box in both directions).
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from fidelity.engine import Movement, Packing, Setup, Wall
from fidelity.grains.filling import (
    Portion,
    loose_in,
    plane,
    rectangle,
    settling_setup,
    strip,
    top_of,
)
from fidelity.grains.settings import MILLI
from fidelity.samples import Columns, Plane, Samples, even_columns
from geometry.mesh import Mesh
from geometry.sections import Section
from mfopt.arrays import Array, frozen
from mfopt.errors import ConfigError

# The part of the mass that left between which the rate is taken: it leaves out the start,
# when grains still gather speed, and the end, when the last of them trickle.
STEADY_FROM, STEADY_TO = 0.2, 0.8
BAR_SIDES = 16  # of the bar's section: 2 % of its radius from chord to arc
FEWEST_STEADY = 5  # grains in that part, below which a rate says nothing
WIDEST_FALL_ANGLE = math.radians(60)  # of a grain's path to the vertical; else it came elsewhere


@dataclass(frozen=True, slots=True)
class DischargeSettings:
    """A hopper of rectangular section, its outlet around x = y = 0 at z = 0."""

    length: float  # [m] of the box along x
    depth: float  # [m] of the box along y
    opening: float  # [m] of the outlet along x
    fall: float  # [m] from the outlet down to where grains are counted
    duration: float  # [s] of the run
    opening_depth: float | None = None  # [m] of the outlet along y; None: a slot, all the depth
    floor_angle: float = 0.0  # [rad] of the floor along x to the horizontal; 0: flat bottom
    floor: float = 0.0  # [m] thickness of the floor: the outlet's sides stand that high
    bar: float = 0.0  # [m] diameter of a bar that lies across the hopper, along y; 0: none
    bar_height: float = 0.0  # [m] of the bar's axis, above the outlet

    @property
    def outlet(self) -> tuple[float, float]:
        """Extent of the outlet along x and y [m]."""
        return self.opening, self.depth if self.opening_depth is None else self.opening_depth

    @property
    def bar_top(self) -> float:
        """Height of the bar's top [m]; 0 without one."""
        return self.bar_height + self.bar / 2 if self.bar > 0 else 0.0

    @property
    def shoulder(self) -> float:
        """Height at which the vertical walls begin [m]."""
        return self.floor + (self.length - self.opening) / 2 * math.tan(self.floor_angle)


@dataclass(frozen=True, slots=True, eq=False)
class Discharge:
    """What left the hopper, and when."""

    times: Array  # (n_passed,) [s] sorted
    grain_mass: float  # [kg]
    left: int  # grains still in the hopper, or between outlet and counter
    lost: int  # grains that got out, but not through the outlet
    scales: Array | None = None  # (n_passed,) sizes of the grains that passed; None: all are 1

    @property
    def mass_flow_rate(self) -> float:
        """Slope of mass over time [kg/s] while 20 to 80 % of what leaves is leaving.

        A least-squares line through the steps of the discharged mass; nan for too few grains.
        """
        n = len(self.times)
        number = np.arange(math.ceil(STEADY_FROM * n), math.floor(STEADY_TO * n))
        if len(number) < FEWEST_STEADY:
            return math.nan
        return self.grain_mass * float(np.polyfit(self.times[number], self._grains[number], 1)[0])

    def mass(self, times: Array) -> Array:
        """Mass that has passed until `times` (m,) [kg]."""
        return self.grain_mass * self._grains[np.searchsorted(self.times, times, side="right")]

    @property
    def _grains(self) -> Array:
        """Mass (n_passed + 1,) that had passed after so many grains [grains of scale 1]."""
        if self.scales is None:
            return np.arange(len(self.times) + 1, dtype=np.float64)
        return np.concatenate([[0.0], np.cumsum(self.scales**3)])


def check_discharge(settings: DischargeSettings) -> None:
    """Refuse a hopper that cannot be built.

    Raises:
        ConfigError: the message names quantity, value, limit and remedy.
    """
    for name in ("length", "depth", "opening", "fall", "duration"):
        value, unit = getattr(settings, name) / MILLI, "ms" if name == "duration" else "mm"
        if not value > 0:
            raise ConfigError(f"{name} = {value:g} {unit} must be positive; enlarge it")
    box, outlet = (settings.length, settings.depth), settings.outlet
    for name, inner, outer in zip(("opening", "opening_depth"), outlet, box, strict=True):
        if not 0 < inner <= outer:
            raise ConfigError(
                f"{name} = {inner / MILLI:g} mm must be positive and at most the box's "
                f"{outer / MILLI:g} mm; "
                "narrow the outlet or widen the box"
            )
    if not settings.floor >= 0:
        raise ConfigError(
            f"floor = {settings.floor / MILLI:g} mm must be at least 0; 0 is a thin floor"
        )
    if settings.bar > 0 and not settings.bar < settings.length:
        raise ConfigError(
            f"bar = {settings.bar / MILLI:g} mm must be thinner than the box's length = "
            f"{settings.length / MILLI:g} mm; use a thinner bar"
        )
    if settings.bar > 0 and not settings.bar_height > settings.bar / 2:
        raise ConfigError(
            f"bar_height = {settings.bar_height / MILLI:g} mm must exceed half of the bar's "
            f"diameter = {settings.bar / 2 / MILLI:g} mm; raise the bar"
        )
    if not 0 <= settings.floor_angle < math.pi / 2:
        raise ConfigError(
            f"floor_angle = {math.degrees(settings.floor_angle):g} deg must be at least 0 and "
            "below 90 deg; 0 is a flat bottom"
        )


def filling_setup(settings: DischargeSettings, portion: Portion, seed: int) -> Setup:
    """Rain the portion onto the closed gate; the loose grains start above the shoulder.

    Raises:
        ConfigError: if the hopper cannot be built.
        SimulationError: if the grain is too long for it.
    """
    check_discharge(settings)
    section = Section(settings.length, settings.depth, 0.0, 0.0)
    loose = loose_in(portion, section, max(settings.shoulder, settings.bar_top), seed)
    gate = portion.wall("gate", plane(*settings.outlet, 0.0))
    walls = vessel(settings, portion, top_of(portion, loose))
    return settling_setup(portion, loose, (*walls, gate))


def discharge_setup(
    settings: DischargeSettings,
    portion: Portion,
    packing: Packing,
    *,
    gate_until: float | None = None,
) -> Setup:
    """Run the settled portion out of the hopper.

    `gate_until` [s] is how long the gate stays closed; None: the run starts without it.
    """
    walls = list(vessel(settings, portion, top_of(portion, packing)))
    if gate_until is not None:
        gate = portion.wall("gate", plane(*settings.outlet, 0.0))
        walls.append(replace(gate, until=gate_until))
    return Setup(
        grain=portion.grain,
        packing=packing,
        grain_material=portion.grain_material,
        walls=tuple(walls),
        physics=portion.physics,
        duration=settings.duration,
        exit_z=-settings.fall,
    )


def discharge_samples(settings: DischargeSettings, portion: Portion, times: Array) -> Samples:
    """What passes the outlet at z = 0, and the fill level in columns one grain wide along x.

    A column ends at the floor below its middle; over the outlet at the outlet's height.

    Args:
        settings: the hopper.
        portion: its grains; a column is as wide as their diameter.
        times: (s,) [s].
    """
    half, (x, y) = settings.length / 2, settings.outlet
    flat = even_columns(-half, half, 2.0 * float(portion.grain.radii.max()))
    middles = (flat.edges[:-1] + flat.edges[1:]) / 2
    beside = np.maximum(np.abs(middles) - x / 2, 0.0)
    floors = beside * math.tan(settings.floor_angle) + settings.floor * (beside > 0.0)
    columns = Columns(flat.edges, frozen(floors))
    outlet = Plane(0.0, (-x / 2, x / 2, -y / 2, y / 2))
    return Samples(frozen(times), (outlet,), columns)


def vessel(settings: DischargeSettings, portion: Portion, top: float) -> tuple[Wall, ...]:
    """The hopper's walls up to the height `top` [m], and the bar if there is one."""
    meshes = vessel_meshes(settings, max(top, settings.shoulder + portion.grain_length))
    return tuple(portion.wall(name, mesh) for name, mesh in meshes.items())


def vessel_meshes(settings: DischargeSettings, top: float) -> dict[str, Mesh]:
    """The hopper up to the height `top` [m], above the shoulder, and the bar if there is one."""
    meshes = {"hopper": hopper_mesh(settings, top)}
    if settings.bar > 0:
        meshes["bar"] = bar_mesh(settings)
    return meshes


def bar_mesh(settings: DischargeSettings) -> Mesh:
    """The bar from the front to the back of the box, without its ends."""
    angles = np.linspace(0.0, 2 * np.pi, BAR_SIDES, endpoint=False)
    x, z = settings.bar / 2 * np.cos(angles), settings.bar / 2 * np.sin(angles)
    ends = [
        np.column_stack([x, np.full(BAR_SIDES, y), z + settings.bar_height])
        for y in (-settings.depth / 2, settings.depth / 2)
    ]
    ring = np.arange(BAR_SIDES)
    return Mesh(np.vstack(ends), np.array(strip(ring, ring + BAR_SIDES)))


def hopper_mesh(settings: DischargeSettings, top: float) -> Mesh:
    """The hopper's walls up to the height `top` [m], above the shoulder."""
    box = settings.length, settings.depth
    heights = [0.0, settings.floor] if settings.floor else [0.0]
    levels = [rectangle(*settings.outlet, z) for z in heights]
    levels += [rectangle(*box, settings.shoulder), rectangle(*box, top)]
    corners = np.array([corner for level in levels for corner in level])
    rings = np.arange(len(corners)).reshape(-1, 4)
    triangles = np.array([t for a, b in pairwise(rings) for t in strip(a, b)])
    a, b, c = np.moveaxis(corners[triangles], 1, 0)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    # A flat bottom has no floor where the outlet takes the whole depth.
    solid = triangles[areas > 1e-9 * settings.length * settings.depth]
    return Mesh(corners, solid)


def discharge_result(
    settings: DischargeSettings,
    portion: Portion,
    movement: Movement,
    scales: Array | None = None,
) -> Discharge:
    """Tell from the movement what left the hopper, and when; `scales` (n,) are the sizes."""
    passed = np.isfinite(movement.exit_times)
    reach = settings.fall * math.tan(WIDEST_FALL_ANGLE) + portion.grain_length / 2
    limit = np.array(settings.outlet) / 2 + reach
    through = np.all(np.abs(movement.positions[:, :2]) <= limit, axis=1)
    order = np.argsort(movement.exit_times, kind="stable")
    order = order[(passed & through)[order]]
    return Discharge(
        times=frozen(movement.exit_times[order]),
        grain_mass=portion.grain.mass,
        left=int((~passed).sum()),
        lost=int((passed & ~through).sum()),
        scales=None if scales is None else frozen(scales[order]),
    )
