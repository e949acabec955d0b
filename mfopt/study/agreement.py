"""Whether a study simulates what the values of a material file hold for.

What a contact is (law, damping, restitution, stiffness, effects) must agree at every level of
grains, for a calibrated value means nothing under another law. The grains themselves (size, shape,
density, friction that was not calibrated) must agree at the target, the last such level: coarser
levels have fewer, larger grains by design, and the target decides.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Any

from fidelity.grains.grain import grain_volume
from fidelity.grains.settings import MILLI, DemSettings
from fidelity.scene import Scene
from mfopt.study.held import Held, held
from mfopt.study.material_file import HeldSettings

SAME = 1e-3  # relative: files have six digits, and friction coefficients become angles
LIKE = 0.1  # relative difference of sizes, aspects and densities that agree
SCATTER = 0.05  # difference of size scatters that agree


def disagreements(
    scene: Scene, levels: Mapping[str, DemSettings], there: HeldSettings
) -> list[str]:
    """What differs, in words.

    Args:
        scene: of the study, with the values of the material.
        levels: of grains by name, with the values of the material; the last one is the target.
        there: what the values hold for.
    """
    x = scene.problem().baseline
    found = []
    for name, dem in levels.items():
        its = held(scene, x, dem)
        found += [f"level {name!r}: {said}" for said in _other_contacts(its, there)]
    name, dem = list(levels.items())[-1]
    count = round(scene.portion(x, dem).mass / _mass(there))
    return found + [
        f"target {name!r}: {said}" for said in _other_grains(held(scene, x, dem), there, count)
    ]


def _mass(its: HeldSettings) -> float:
    """Mass of a simulated grain [kg]."""
    length, width = MILLI * its.grain_length_mm, MILLI * its.grain_width_mm
    return its.density_kg_m3 * grain_volume(length, width, its.spheres_per_grain)


def _other_contacts(ours: Held, there: HeldSettings) -> Iterator[str]:
    """How contacts differ, in words."""
    for key in ("contact_law", "damping", "damp_gravity", "restitution"):
        mine, its = getattr(ours, key), getattr(there, key)
        if not _equal(mine, its):
            yield f"{key} is {_said(mine)}, and the material's {_said(its)}"
    low, high = there.young_modulus_pa
    if not low * (1.0 - SAME) <= ours.young_modulus_pa <= high * (1.0 + SAME):
        yield (
            f"young_modulus_pa is {ours.young_modulus_pa:g}, and must be from {low:g} to {high:g}"
        )
    for name in sorted({*ours.effects, *there.effects}):
        mine, its = ours.effects.get(name), there.effects.get(name)
        if not _equal(mine, its):
            yield f"effects.{name} is {_said(mine)}, and the material's {_said(its)}"


def _other_grains(ours: Held, there: HeldSettings, count: int) -> Iterator[str]:
    """How grains differ, in words; so many grains would have the size of the material's."""
    for key in ("friction", "wall_friction"):
        mine, its = getattr(ours, key), getattr(there, key)
        if not _equal(mine, its):
            angles = math.degrees(math.atan(mine)), math.degrees(math.atan(its))
            yield (
                f"{key} is {mine:.3g} ({angles[0]:.3g} degrees), and the material's {its:.3g} "
                f"({angles[1]:.3g} degrees)"
            )
    if not _like(ours.density_kg_m3, there.density_kg_m3):
        yield f"density_kg_m3 is {ours.density_kg_m3:g}, and the material's {there.density_kg_m3:g}"
    if ours.spheres_per_grain != there.spheres_per_grain:
        yield (
            f"spheres_per_grain is {ours.spheres_per_grain}, and the material's "
            f"{there.spheres_per_grain}"
        )
    aspects = (
        ours.grain_length_mm / ours.grain_width_mm,
        there.grain_length_mm / there.grain_width_mm,
    )
    if not _like(*aspects):
        yield f"length over width is {aspects[0]:.3g}, and the material's {aspects[1]:.3g}"
    if not _like(ours.grain_length_mm, there.grain_length_mm):
        yield (
            f"a simulated grain is {ours.grain_length_mm:.3g} mm long, and the material's "
            f"{there.grain_length_mm:.3g} mm (grains = {count} makes them alike)"
        )
    if abs(ours.size_scatter - there.size_scatter) > SCATTER:
        yield f"size_scatter is {ours.size_scatter:g}, and the material's {there.size_scatter:g}"


def _equal(mine: Any, its: Any) -> bool:
    if isinstance(mine, float) and isinstance(its, float):
        return math.isclose(mine, its, rel_tol=SAME, abs_tol=1e-9)
    if isinstance(mine, Mapping) and isinstance(its, Mapping):
        return mine.keys() == its.keys() and all(_equal(mine[key], its[key]) for key in mine)
    return bool(mine == its)


def _like(mine: float, its: float) -> bool:
    return abs(mine / its - 1.0) <= LIKE


def _said(value: Any) -> str:
    match value:
        case None:
            return "none"
        case float():
            return f"{value:g}"
        case Mapping():
            return "{ " + ", ".join(f"{k} = {v:g}" for k, v in value.items()) + " }"
        case _:
            return str(value)
