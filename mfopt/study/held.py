"""What calibrated values hold for: the grains and numerics of a scene at one level."""

import math
from dataclasses import dataclass

import numpy as np

from fidelity.effects.switch import EFFECTS, effect_named
from fidelity.engine import ContactLaw
from fidelity.grains.settings import DemSettings
from fidelity.scene import Scene
from mfopt.arrays import Array
from mfopt.records.effect import complete, is_absent

APPARATUS = "apparatus"  # tag of effects of the machine, which say nothing of the material


@dataclass(frozen=True, slots=True)
class Held:
    """Grains and numerics as simulated, with all effects on grains."""

    contact_law: ContactLaw
    damping: float
    damp_gravity: bool  # False without damping
    restitution: float | None
    young_modulus_pa: float
    friction: float  # coefficient between grains
    wall_friction: float  # of grains on walls
    density_kg_m3: float
    grain_length_mm: float
    grain_width_mm: float
    spheres_per_grain: int
    size_scatter: float
    effects: dict[str, dict[str, float]]  # those of the material or the numerics that are present


def held(scene: Scene, x: Array, dem: DemSettings) -> Held:
    """What is simulated at the design `x` (d,)."""
    portion = scene.portion(x, dem)
    grain, physics = portion.grain, portion.physics
    radius = float(grain.radii.max())
    friction = portion.grain_material.friction_angle
    on_walls = portion.wall_friction_angle
    if on_walls is None:
        on_walls = min(friction, portion.wall_material.friction_angle)
    return Held(
        contact_law=physics.contact_law,
        damping=physics.damping,
        damp_gravity=physics.damp_gravity and physics.damping > 0.0,
        restitution=physics.restitution,
        young_modulus_pa=portion.grain_material.young_modulus,
        friction=math.tan(friction),
        wall_friction=math.tan(on_walls),
        density_kg_m3=portion.grain_material.density,
        grain_length_mm=1e3 * (float(np.ptp(grain.offsets[:, 0])) + 2.0 * radius),
        grain_width_mm=2e3 * radius,
        spheres_per_grain=len(grain.radii),
        size_scatter=portion.sizes.scatter,
        effects={
            name: complete(effect_named(name).effect, values)
            for name, values in sorted(dem.effects.items())
            if not is_apparatus(name) and not is_absent(effect_named(name).effect, values)
        },
    )


def is_apparatus(effect: str) -> bool:
    """Whether an effect is of the machine, such as a tilt, and not of the grains."""
    return effect in EFFECTS and EFFECTS[effect].effect.tag == APPARATUS
