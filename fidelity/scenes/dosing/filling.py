"""Filling the cup with its portion, up to the rim.

The grains settle with little friction and much damping, or coarse grains would not fit the cup.
"""

import logging
import math
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from fidelity.engine import Engine, Grain, Material, Packing, Physics, Setup, Wall
from fidelity.grains.packing import Settled
from fidelity.grains.portion import flaw, loose_portion
from geometry.mesh import Mesh
from geometry.parts import Cup, cup_wall
from mfopt.arrays import frozen
from mfopt.errors import SimulationError

METHOD = 2  # counted up when packings are made differently, so that old ones are not used
SETTLING_DAMPING = 0.4  # [-] numerical damping; brings the portion to rest soon
# A portion fills the cup to the rim: 1 kg in 1279 ml is 49 % solid. Grains that settle with
# their full friction stop at 38 %; with this friction 300 of them reach the 49 %, sooner.
SETTLING_FRICTION = math.radians(5)  # [rad]
LONGEST_SETTLING = 0.3  # [s] then the grains creep at a few cm/s, and are taken to be at rest
# Stiff grains need short steps. They fall as softer ones, and are then stiffened tenfold at a time:
# at once, the overlaps of the softer ones would throw them about.
SOFT = 1e6  # [Pa] Young's modulus
STIFFENING = 10.0
RELAXATION = 0.03  # [s] after each stiffening
FLOOR_MARGIN = 0.05  # [m] floor around the cup

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, eq=False)
class CupFilling:
    """Everything that a settled portion in the cup depends on.

    Implements `fidelity.grains.packing.Filling`.
    """

    grain: Grain
    grain_material: Material
    wall_material: Material
    physics: Physics
    cup: Cup
    collar: float  # [m] height of the cup's walls while grains are in it
    chordal_error: float  # [m] of the cup's mesh
    grains: int
    seed: int

    def described(self) -> dict[str, Any]:
        """All that the packing depends on, besides the engine."""
        method = [METHOD, SETTLING_DAMPING, SETTLING_FRICTION, LONGEST_SETTLING, RELAXATION]
        return {"method": method, **asdict(self)}

    def flaw(self, packing: Packing) -> str | None:
        """Why a packing cannot be used, or None."""
        return flaw(self.grain, self.cup.section, self.collar, self.grains, packing)

    def settle(self, engine: Engine, time_limit_s: float) -> Settled:
        """Let the portion settle, the cup's floor at z = 0 and its centre at x = y = 0.

        Raises:
            SimulationError: if the grains cannot be settled; the message says what happened.
        """
        loose = loose_portion(
            self.grain, self.cup.section, self.grains, self.seed, chordal_error=self.chordal_error
        )
        # The loose layers may stand higher than the collar; meanwhile the walls reach as high.
        top = float(loose.positions[:, 2].max()) + 2 * float(self.grain.radii.max())
        tall = cup_wall(self.cup, self.chordal_error, height=max(self.collar, top))
        wall = _slippery(self.wall_material)
        walls = (Wall("cup", tall.vertices, tall.triangles, wall), _floor(self.cup, wall))
        packing, cpu_s, work, why = loose, 0.0, 0.0, None
        for modulus in moduli(self.grain_material.young_modulus):
            material = replace(_slippery(self.grain_material), young_modulus=modulus)
            setup = Setup(
                grain=self.grain,
                packing=packing,
                grain_material=material,
                walls=walls,
                physics=replace(self.physics, damping=SETTLING_DAMPING),
                duration=LONGEST_SETTLING if packing is loose else RELAXATION,
                exit_z=-FLOOR_MARGIN,
                settle=True,
            )
            movement = engine.move(setup, time_limit_s=time_limit_s)
            cpu_s += movement.cpu_s
            work += movement.sphere_steps * engine.cost_factor
            why = movement.why
            if movement.status != "finished":
                break
            packing = Packing(frozen(movement.positions), frozen(movement.orientations))
        why = why or self.flaw(packing)
        if why is not None:
            raise SimulationError(f"settling the portion in the cup failed: {why}")
        log.info("settled %d grains in %.1f CPU seconds", self.grains, cpu_s)
        return Settled(packing, cpu_s, work)


def cup_mesh(filling: CupFilling) -> Mesh:
    """Walls of the cup with its collar, floor at z = 0."""
    return cup_wall(filling.cup, filling.chordal_error, height=filling.collar)


def moduli(young_modulus: float) -> list[float]:
    """Young's moduli [Pa] that the grains settle with, one after the other."""
    values = [min(SOFT, young_modulus)]
    while values[-1] < young_modulus:
        values.append(min(STIFFENING * values[-1], young_modulus))
    return values


def _slippery(material: Material) -> Material:
    """The material with the friction that it settles with."""
    return replace(material, friction_angle=SETTLING_FRICTION)


def _floor(cup: Cup, material: Material) -> Wall:
    x = cup.section.length / 2 + FLOOR_MARGIN
    y = cup.section.width / 2 + FLOOR_MARGIN
    corners = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
    return Wall("floor", corners, np.array([[0, 1, 2], [0, 2, 3]]), material)
