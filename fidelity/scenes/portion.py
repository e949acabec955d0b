"""The grains of a scene that gives their mass, shape and materials."""

from fidelity.effects.switch import with_effects
from fidelity.grains.filling import Portion
from fidelity.grains.grain import portion_grain
from fidelity.grains.settings import DemSettings, MaterialSettings

MILLI = 1e-3


def portion_of(
    mass_kg: float,
    length_mm: float,
    width_mm: float,
    grain: MaterialSettings,
    wall: MaterialSettings,
    dem: DemSettings,
) -> Portion:
    """Grains of that shape, scaled so that as many as the level has weigh `mass_kg`.

    Effects of the level that act on grains are switched on.
    """
    shape = portion_grain(
        mass=mass_kg,
        density=grain.density_kg_m3,
        length=MILLI * length_mm,
        width=MILLI * width_mm,
        grains=dem.grains,
        spheres=dem.spheres_per_grain,
    )
    material = grain.material(dem.young_modulus_pa)
    portion = Portion(shape, dem.grains, material, wall.material(), dem.physics())
    return with_effects(portion, dem.effects)
