"""Settings of the dosing scene, as a study file gives them; units are in the names.

Values are those of the paper on the optimisation of a vertical tubular bag machine (tables
1 and 2, sections 1.1 to 1.3) and, where it is silent, assumptions that a study can change.
The records keep the user's units; what leaves this module as a `Material` is SI.
"""

import math
from collections.abc import Mapping
from typing import Annotated

from pydantic import Field, Strict, field_validator, model_validator

from fidelity.engine import Material
from mfopt.settings import Settings, nearest

Bounds = Annotated[tuple[float, float], Strict(False)]  # TOML gives a list

# Every number that describes a design: z, l, w, r, s of sections 0 (hole) to 3 (tube) [mm],
# and the motion's x1, y1, x2, y2, v [-]. z0 = 0 is the plate and no parameter.
MOTION_PARAMETERS = ("x1", "y1", "x2", "y2", "v")
SECTION_PARAMETERS = tuple(
    f"{letter}{i}" for i in range(4) for letter in "zlwrs" if (letter, i) != ("z", 0)
)
PARAMETERS = SECTION_PARAMETERS + MOTION_PARAMETERS

# Given values; l, w, r, s of sections 1 and 2 lie on the straight line from hole to tube
# unless given. The motion is a constant speed: P1 and P2 on the diagonal, v = 1.
DEFAULT_VALUES: Mapping[str, float] = {
    "l0": 150, "w0": 115, "r0": 25, "s0": 0,
    "z1": -80, "z2": -180, "z3": -260,
    "l3": 95, "w3": 70, "r3": 25, "s3": 0,
    "x1": 0.25, "y1": 0.25, "x2": 0.75, "y2": 0.75, "v": 1.0,
}  # fmt: skip
DEFAULT_FREE: Mapping[str, Bounds] = {
    "l1": (80, 180), "w1": (60, 140), "r1": (5, 45), "s1": (-40, 40),
    "l2": (70, 150), "w2": (50, 120), "r2": (5, 40), "s2": (-30, 30),
    "x1": (0.05, 0.45), "y1": (0.1, 0.9), "x2": (0.55, 0.95), "y2": (0.1, 0.9), "v": (0.2, 4),
}  # fmt: skip


class CupSettings(Settings):
    """The dosing cup's inside; its height follows from the volume."""

    length_mm: float = Field(130, gt=0)
    width_mm: float = Field(100, gt=0)
    radius_mm: float = Field(20, ge=0)
    volume_ml: float = Field(1279, gt=0)


class MaterialSettings(Settings):
    """Elastic-frictional material."""

    young_modulus_pa: float = Field(gt=0)
    poisson_ratio: float = Field(gt=0, lt=0.5)
    density_kg_m3: float = Field(gt=0)
    friction_angle_deg: float = Field(ge=0, lt=90)

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


class DosingSettings(Settings):
    """The dosing problem: machine, portion, materials, and which parameters are free."""

    cup: CupSettings = CupSettings()
    stroke_mm: float = Field(400, gt=0)
    cycle_ms: float = Field(600, gt=0)
    duration_ms: float = Field(1200, gt=0, description="a run ends here at the latest")
    tube_end_z_mm: float = -560
    # 1 kg of rice a cycle (paper, section 2.2). Mass and number of grains are kept, and the
    # grain's scale follows from them: 18 380 grains come out 1.24 times as large as a grain of
    # 7 mm x 2 mm. At the 1.5 times that the paper names they would be 1.1 l of solid rice, more
    # than a cup of 1279 ml can hold.
    portion_kg: float = Field(1.0, gt=0)
    grain_length_mm: float = Field(7, gt=0)
    grain_width_mm: float = Field(2, gt=0)
    grain: MaterialSettings = RICE
    wall: MaterialSettings = STEEL
    free: dict[str, Bounds] = Field(default_factory=lambda: dict(DEFAULT_FREE), min_length=1)
    values: dict[str, float] = Field(default_factory=dict)

    @field_validator("free", "values")
    @classmethod
    def _known(cls, given: dict[str, object]) -> dict[str, object]:
        for name in given:
            if name not in PARAMETERS:
                raise ValueError(f"unknown design parameter {name!r}{nearest(name, PARAMETERS)}")
        return given

    @model_validator(mode="after")
    def _consistent(self) -> "DosingSettings":
        if self.grain_length_mm < self.grain_width_mm:
            raise ValueError(
                f"grain_length_mm = {self.grain_length_mm:g} must be at least "
                f"grain_width_mm = {self.grain_width_mm:g}; exchange them"
            )
        if self.duration_ms < self.cycle_ms:
            raise ValueError(
                f"duration_ms = {self.duration_ms:g} must be at least "
                f"cycle_ms = {self.cycle_ms:g}; lengthen the run"
            )
        z3 = self.all_values()["z3"]
        lowest = self.free["z3"][0] if "z3" in self.free else z3
        if self.tube_end_z_mm >= lowest:
            raise ValueError(
                f"tube_end_z_mm = {self.tube_end_z_mm:g} must lie below the tube's upper "
                f"end z3 = {lowest:g}; lower it"
            )
        return self

    def all_values(self) -> dict[str, float]:
        """Value of every design parameter, with sections 1 and 2 on the straight line.

        A free parameter's value is where the search starts: the baseline.
        """
        values = {**DEFAULT_VALUES, **self.values}
        for i in (1, 2):
            share = values[f"z{i}"] / values["z3"]  # 0 at the hole, 1 at the tube
            for letter in "lwrs":
                hole, tube = values[f"{letter}0"], values[f"{letter}3"]
                values.setdefault(f"{letter}{i}", hole + share * (tube - hole))
        return values


class DemSettings(Settings):
    """How finely one level resolves the grains, and its numerics."""

    grains: int = Field(ge=1)
    spheres_per_grain: int = Field(5, ge=1)
    # Softer grains allow longer time steps and hardly change the discharge: 5e5 to 5e7 Pa
    # differ by less than the scatter between seeds.
    young_modulus_pa: float = Field(1e6, gt=0)
    damping: float = Field(0.125, ge=0, lt=1)  # paper, table 1
    damp_gravity: bool = False  # True: damping slows free fall too, as in the paper
    # Of r_min sqrt(density / E). At 0.9 one run in ten exploded where the cup pinched grains, at
    # 0.6 none of those did.
    timestep_factor: float = Field(0.6, gt=0)
    chordal_error_mm: float | None = Field(None, gt=0)  # a quarter of the sphere radius if None
    time_limit_s: float = Field(7200, gt=0)
