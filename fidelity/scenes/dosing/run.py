"""One dosing run: what an engine is given, and what became of every grain.

The settled cup starts half a stroke before the hole, and its grains move with it: in a machine that
runs cycle after cycle both come with the speed at which the last cycle ended. Time counts from
there. A coarse portion stands higher than the rim of the cup, and a
fast cup throws grains up: so the simulated walls of the cup reach higher, with a collar of the
same section, up to the roof of a housing around the plate. Grains that the rim
of the cup cuts or flings aside at the hole's edge stay in the housing, on the plate; they count
as left in the cup.
"""

from dataclasses import dataclass, replace

import numpy as np

from fidelity.effects.kinds import PortionEffect
from fidelity.effects.switch import effect_named, is_on
from fidelity.engine import Grain, Material, Movement, Packing, Setup, Wall, WallMotion
from fidelity.grains.grain import portion_grain
from fidelity.grains.portion import depth_in_section, depth_inside
from fidelity.grains.settings import MILLI, DemSettings
from fidelity.scene import raw_of
from fidelity.scenes.dosing.design import MOTION_STEP, Design, dosing_cup, plate
from fidelity.scenes.dosing.filling import CupFilling, cup_mesh
from fidelity.scenes.dosing.settings import DosingSettings
from geometry.mesh import Mesh
from geometry.parts import passage
from mfopt.arrays import AnyArray, Array, frozen
from mfopt.errors import ConfigError

# `timestep_factor`: at 0.9 one run in ten exploded where the cup pinched grains, at 0.6 none.
PINCHING_STEP = 0.6
COLLAR = 2.5  # height of the simulated walls of the cup in heights of the cup
CHORDAL_ERROR = 0.25  # [sphere radii] finer meshes change no result
EMPTYING_FIRST = 0.25  # share of the cycle at which the first snapshot is taken


@dataclass(frozen=True, slots=True)
class Tally:
    """Where the grains are at the end of a run."""

    passed: Array  # (n_passed,) [s] sorted times at the tube's end
    left_in_cup: int  # with those on the plate
    left_in_hopper: int
    lost: int
    left_on_plate: int  # above the plate, but outside of the cup
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


def cup_filling(settings: DosingSettings, dem: DemSettings, seed: int) -> CupFilling:
    """The settled portion that a run of the level starts from.

    Raises:
        ConfigError: if an effect changes the grains, which the cup's filling does not know.
    """
    for name in dem.effects:
        if isinstance(effect_named(name), PortionEffect) and is_on(dem.effects, name):
            raise ConfigError(f"the scene dosing lacks the effect {name!r}; leave it out")
    grain, cup = dosing_grain(settings, dem), dosing_cup(settings)
    error = dem.chordal_error_mm
    return CupFilling(
        grain=grain,
        grain_material=settings.grain.material(dem.young_modulus_pa),
        wall_material=settings.wall.material(),
        physics=dem.physics(PINCHING_STEP),
        cup=cup,
        collar=COLLAR * cup.height,
        chordal_error=CHORDAL_ERROR * float(grain.radii.min()) if error is None else MILLI * error,
        grains=dem.grains,
        seed=seed,
    )


def dosing_setup(
    settings: DosingSettings,
    machine: Design,
    filling: CupFilling,
    packing: Packing,
    snapshots: int = 0,
) -> Setup:
    """What the engine is given: walls, the cup's motion, and the settled portion at the start."""
    times = np.linspace(0.0, machine.cycle, round(machine.cycle / MOTION_STEP) + 1)
    positions = machine.cup_position(times)
    way = np.zeros((times.size, 3))
    way[:, 0] = positions - positions[0]
    speed = float(machine.cup_velocity(np.zeros(1))[0])
    start = np.array([positions[0], 0.0, 0.0])
    cup, error = cup_mesh(filling), filling.chordal_error
    hopper, table = passage(machine.loft, machine.tube_end_z, error), plate(machine, error)
    material, motion = filling.wall_material, WallMotion(frozen(times), frozen(way))
    walls = (
        Wall("cup", cup.vertices + start, cup.triangles, material, motion),
        Wall("plate", table.vertices, table.triangles, material),
        Wall("hopper", hopper.vertices, hopper.triangles, material),
        _housing(table, filling.collar, material),
    )
    angle = settings.wall_friction_angle
    return Setup(
        grain=filling.grain,
        packing=Packing(frozen(packing.positions + start), packing.orientations),
        grain_material=filling.grain_material,
        walls=tuple(replace(wall, friction_angle=angle) for wall in walls),
        physics=filling.physics,
        duration=MILLI * settings.duration_ms,
        exit_z=machine.tube_end_z,
        velocities=frozen(np.tile([speed, 0.0, 0.0], (len(packing.positions), 1))),
        idle_after=machine.cycle,
        idle_above_z=0.0,
        snapshot_times=frozen(np.linspace(EMPTYING_FIRST, 1.0, snapshots) * machine.cycle),
        may_pinch=True,  # between the cup's rim and the hole's edge; `tally` finds every grain
    )


def _housing(table: Mesh, height: float, material: Material) -> Wall:
    """Side walls on the rim of the plate, and a roof at `height` [m]."""
    low, high = table.vertices.min(axis=0)[:2], table.vertices.max(axis=0)[:2]
    rim = [[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]]
    corners = np.array([[x, y, z] for z in (0.0, height) for x, y in rim])
    sides = [[i, (i + 1) % 4, 4 + (i + 1) % 4] for i in range(4)]
    sides += [[i, 4 + (i + 1) % 4, 4 + i] for i in range(4)]
    return Wall("housing", corners, np.array([*sides, [4, 5, 6], [4, 6, 7]]), material)


def tally(machine: Design, setup: Setup, movement: Movement) -> Tally:
    """Count every grain: passed, left above the plate, left below it; anywhere else it is lost.

    Grains count by their mass centre; as walls give way by an overlap, a grain may be off by
    one sphere radius.
    """
    slack = float(setup.grain.radii.max())
    where, z = movement.positions, movement.positions[:, 2]
    gone = np.isfinite(movement.exit_times)
    in_passage = _depth_in_passage(machine, where) > -slack
    corners = next(w.vertices for w in setup.walls if w.name == "housing")
    low, high = corners.min(axis=0) - slack, corners.max(axis=0) + slack
    housed = np.all((where >= low) & (where <= high), axis=1)
    below, passed = ~gone & (z < 0) & in_passage, gone & in_passage
    above = ~gone & ~below & housed
    cup_x = float(machine.cup_position(np.array([movement.end_time]))[0])
    in_cup = depth_in_section(machine.cup.section, where[:, :2] - [cup_x, 0.0]) > -slack
    lost = ~(above | below | passed)
    return Tally(
        passed=frozen(np.sort(movement.exit_times[passed])),
        left_in_cup=int(above.sum()),
        left_in_hopper=int(below.sum()),
        lost=int(lost.sum()),
        left_on_plate=int((above & ~in_cup).sum()),
        first_lost=_place(where[lost][0]) if lost.any() else "",
    )


def _place(position: Array) -> str:
    x, y, z = 1e3 * position
    return f"x = {x:.0f}, y = {y:.0f}, z = {z:.0f} mm"


def _depth_in_passage(machine: Design, points: Array) -> Array:
    """How far points (n, 3) lie inside hopper or tube at their height [m]."""
    z = np.clip(points[:, 2], machine.loft.heights[-1], 0.0)
    return depth_inside(machine.loft.values(z), points[:, :2])


def raw_results(setup: Setup, movement: Movement, count: Tally, seed: int) -> dict[str, AnyArray]:
    """The raw outcome of a run, SI units."""
    values = {
        "passage_times": count.passed,
        "passed": len(count.passed),
        "left_in_cup": count.left_in_cup,
        "left_in_hopper": count.left_in_hopper,
        "lost": count.lost,
        "left_on_plate": count.left_on_plate,
        "steps": movement.steps,
        "packing_seed": seed,
    }
    return raw_of(values, setup, movement)
