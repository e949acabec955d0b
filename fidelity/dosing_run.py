"""One dosing run: what an engine is given, and what became of every grain.

The grains start at rest in the settled cup, half a stroke before the hole, and the cup moves
at once; time counts from there. A coarse portion stands higher than the rim of the cup, and a
fast cup throws grains up: so the simulated walls of the cup reach higher, with a collar of the
same section.
"""

from dataclasses import dataclass

import numpy as np

from fidelity.dosing import MILLI, MOTION_STEP, Design, dosing_cup, plate
from fidelity.engine import Grain, Movement, Packing, Physics, Setup, Wall, WallMotion
from fidelity.grain import portion_grain
from fidelity.packing import Order, cup_mesh
from fidelity.portion import depth_in_section, depth_inside
from fidelity.settings import DemSettings, DosingSettings
from geometry.parts import passage
from mfopt.arrays import AnyArray, Array, frozen

COLLAR = 2.5  # height of the simulated walls of the cup in heights of the cup
CHORDAL_ERROR = 0.25  # [sphere radii] a mesh this fine is rougher than nothing that matters
GRAVITY = 9.81  # [m/s2]
EMPTYING_FIRST = 0.25  # share of the cycle at which the first snapshot is taken


@dataclass(frozen=True, slots=True)
class Tally:
    """Where the grains are at the end of a run."""

    passed: Array  # (n_passed,) [s] sorted times at the tube's end
    left_in_cup: int
    left_in_hopper: int
    lost: int
    first_lost: str = ""  # where the first of the lost ones was


def dosing_grain(settings: DosingSettings, dem: DemSettings) -> Grain:
    """The grain of a level: shape kept, size from the portion's mass and number."""
    return portion_grain(
        mass=settings.portion_kg,
        density=settings.grain.density_kg_m3,
        length=MILLI * settings.grain_length_mm,
        width=MILLI * settings.grain_width_mm,
        grains=dem.grains,
        spheres=dem.spheres_per_grain,
    )


def packing_order(settings: DosingSettings, dem: DemSettings, seed: int) -> Order:
    """The settled portion that a run of the level starts from."""
    grain, cup = dosing_grain(settings, dem), dosing_cup(settings)
    error = dem.chordal_error_mm
    return Order(
        grain=grain,
        grain_material=settings.grain.material(dem.young_modulus_pa),
        wall_material=settings.wall.material(),
        physics=Physics(
            damping=dem.damping,
            damp_gravity=dem.damp_gravity,
            gravity=GRAVITY,
            timestep_factor=dem.timestep_factor,
        ),
        cup=cup,
        collar=COLLAR * cup.height,
        chordal_error=CHORDAL_ERROR * float(grain.radii.min()) if error is None else MILLI * error,
        grains=dem.grains,
        seed=seed,
    )


def dosing_setup(
    settings: DosingSettings, machine: Design, order: Order, packing: Packing, snapshots: int = 0
) -> Setup:
    """What the engine is given: walls, the cup's motion, and the settled portion at the start."""
    times = np.linspace(0.0, machine.cycle, round(machine.cycle / MOTION_STEP) + 1)
    positions = machine.cup_position(times)
    start = np.array([positions[0], 0.0, 0.0])
    cup, error = cup_mesh(order), order.chordal_error
    hopper, table = passage(machine.loft, machine.tube_end_z, error), plate(machine, error)
    return Setup(
        grain=order.grain,
        packing=Packing(frozen(packing.positions + start), packing.orientations),
        grain_material=order.grain_material,
        wall_material=order.wall_material,
        walls=(
            Wall("cup", cup.vertices + start, cup.triangles, moves=True),
            Wall("plate", table.vertices, table.triangles),
            Wall("hopper", hopper.vertices, hopper.triangles),
        ),
        physics=order.physics,
        duration=MILLI * settings.duration_ms,
        exit_z=machine.tube_end_z,
        motion=WallMotion(frozen(times), frozen(positions - positions[0])),
        idle_after=machine.cycle,
        idle_above_z=0.0,
        snapshot_times=frozen(np.linspace(EMPTYING_FIRST, 1.0, snapshots) * machine.cycle),
    )


def tally(machine: Design, setup: Setup, movement: Movement) -> Tally:
    """Count every grain: passed, left in cup, left in hopper; anywhere else it is lost.

    Grains count by their mass centre; a wall that a grain leans on may be half a grain off.
    """
    slack = float(setup.grain.radii.max())
    where, z = movement.positions, movement.positions[:, 2]
    gone = np.isfinite(movement.exit_times)
    cup_x = float(machine.cup_position(np.array([movement.end_time]))[0])
    cup_depth = depth_in_section(machine.cup.section, where[:, :2] - [cup_x, 0.0])
    below = _depth_in_passage(machine, where) > -slack
    in_cup = ~gone & (z >= 0) & (cup_depth > -slack) & (z < COLLAR * machine.cup.height)
    in_hopper = ~gone & (z < 0) & below
    passed = gone & below
    lost = ~(in_cup | in_hopper | passed)
    first = ""
    if lost.any():
        x, y, height = 1e3 * where[np.flatnonzero(lost)[0]]
        first = f"x = {x:.0f}, y = {y:.0f}, z = {height:.0f} mm"
    return Tally(
        passed=frozen(np.sort(movement.exit_times[passed])),
        left_in_cup=int(in_cup.sum()),
        left_in_hopper=int(in_hopper.sum()),
        lost=int(lost.sum()),
        first_lost=first,
    )


def _depth_in_passage(machine: Design, points: Array) -> Array:
    """How far points (n, 3) lie inside hopper or tube at their height [m]."""
    z = np.clip(points[:, 2], machine.loft.heights[-1], 0.0)
    return depth_inside(machine.loft.values(z), points[:, :2])


def raw_results(setup: Setup, movement: Movement, count: Tally, seed: int) -> dict[str, AnyArray]:
    """The raw outcome of a run, SI units."""
    values = {
        "passage_times": count.passed,
        "grains": len(movement.exit_times),
        "passed": len(count.passed),
        "left_in_cup": count.left_in_cup,
        "left_in_hopper": count.left_in_hopper,
        "lost": count.lost,
        "duration": setup.duration,
        "end_time": movement.end_time,
        "steps": movement.steps,
        "timestep": movement.timestep,
        "max_overlap": movement.max_overlap,
        "packing_seed": seed,
    }
    snapshots = {name: np.asarray(a, np.float32) for name, a in movement.snapshots.items()}
    return {**{name: np.asarray(value) for name, value in values.items()}, **snapshots}
