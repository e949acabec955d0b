"""Settings of grains, as study files give them: material, resolution and numerics of a level."""

import math
from collections.abc import Mapping
from dataclasses import fields

from pydantic import BeforeValidator, Field

from fidelity.engine import ContactLaw, Material, Physics
from mfopt.limits import (
    ChordalError,
    Damping,
    Density,
    FrictionAngle,
    Grains,
    Modulus,
    PoissonRatio,
    Restitution,
    SpheresPerGrain,
    TimeLimit,
    TimestepFactor,
)
from mfopt.settings import Settings

MILLI = 1e-3  # [m] in a mm, [s] in a ms
GRAVITY = 9.81  # [m/s2]


class MaterialSettings(Settings):
    """Elastic-frictional material."""

    young_modulus_pa: Modulus
    poisson_ratio: PoissonRatio
    density_kg_m3: Density
    friction_angle_deg: FrictionAngle

    def material(self, young_modulus: float | None = None) -> Material:
        """The material in SI, with another Young's modulus [Pa] if one is given."""
        return Material(
            young_modulus=self.young_modulus_pa if young_modulus is None else young_modulus,
            poisson_ratio=self.poisson_ratio,
            friction_angle=math.radians(self.friction_angle_deg),
            density=self.density_kg_m3,
        )


RICE = MaterialSettings(
    young_modulus_pa=1e8, poisson_ratio=0.2, density_kg_m3=1592.67, friction_angle_deg=43
)  # paper, table 1
STEEL = MaterialSettings(
    young_modulus_pa=2e11, poisson_ratio=0.33, density_kg_m3=7800, friction_angle_deg=25
)  # paper, table 1


def completed_from(usual: MaterialSettings) -> BeforeValidator:
    """Lets a table of a material leave out values, which are then those of the usual material."""

    def complete(given: object) -> object:
        return {**usual.model_dump(), **given} if isinstance(given, Mapping) else given

    return BeforeValidator(complete)


class DemSettings(Settings):
    """How finely one level resolves the grains, and its numerics."""

    grains: Grains
    spheres_per_grain: SpheresPerGrain = 5
    # Softer grains allow longer time steps and hardly change the discharge: 5e5 to 5e7 Pa
    # differ by less than the scatter between seeds.
    young_modulus_pa: Modulus = 1e6
    damping: Damping = 0.125  # paper, table 1
    damp_gravity: bool = False  # True: damping slows free fall too, as in the paper
    timestep_factor: TimestepFactor | None = None  # of r_min sqrt(density / E); None: usual
    contact_law: ContactLaw = "linear"  # springs of Cundall and Strack, or Hertz and Mindlin
    restitution: Restitution | None = None  # needed by hertz
    # Effects of `fidelity.effects` by name, each with its parameters in SI units.
    effects: dict[str, dict[str, float]] = Field(default_factory=dict)
    chordal_error_mm: ChordalError | None = None  # a quarter of the sphere radius if None
    time_limit_s: TimeLimit = 7200

    def physics(self, usual_step: float | None = None) -> Physics:
        """Contact and integration settings, with the gravity of the earth.

        A field here that has the name of one of `Physics` is passed on to the engine.
        `usual_step` is the `timestep_factor` where the study gives none; None: that of the engine.
        """
        names = {field.name for field in fields(Physics)} & DemSettings.model_fields.keys()
        given = {name: getattr(self, name) for name in names}
        if self.timestep_factor is None:
            given["timestep_factor"] = usual_step
        return Physics(**given, gravity=GRAVITY)
