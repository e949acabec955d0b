"""Settings of the dosing scene, as a study file gives them; units are in the names.

Values are those of the paper on the optimisation of a vertical tubular bag machine (tables
1 and 2, sections 1.1 to 1.3) and, where it is silent, assumptions that a study can change.
The records keep the user's units; what leaves this module as a `Material` is SI.
"""

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar

from pydantic import Field, field_validator, model_validator

from fidelity.grains.settings import RICE, STEEL, MaterialSettings, completed_from
from fidelity.scene import PortionSettings
from mfopt.limits import (
    Bounds,
    DesignValue,
    Kilograms,
    Millilitres,
    Millimetres,
    Milliseconds,
)
from mfopt.settings import Settings, nearest

# Every number that describes a design: z, l, w, r, s of sections 0 (hole) to 3 (tube) [mm],
# and the motion's x1, y1, x2, y2, v [-]. z0 = 0 is the plate and no parameter.
MOTION_PARAMETERS = ("x1", "y1", "x2", "y2", "v")
SECTION_PARAMETERS = tuple(
    f"{letter}{i}" for i in range(4) for letter in "zlwrs" if (letter, i) != ("z", 0)
)
PARAMETERS = SECTION_PARAMETERS + MOTION_PARAMETERS

# What an engineer would try first: x1, y1, x2, y2, v. Any of them can be the best, depending on
# cup, cycle and grains.
SIMPLE_MOTIONS: Mapping[str, tuple[float, float, float, float, float]] = {
    "constant": (0.25, 0.25, 0.75, 0.75, 1.0),
    "dwell": (0.25, 0.5, 0.75, 0.5, 1.5),
    "dwell long": (0.2, 0.5, 0.8, 0.5, 1.5),
    "dwell fast": (0.2, 0.5, 0.6, 0.5, 2.5),
    "slow": (0.2, 0.45, 0.7, 0.55, 2.0),
    "slow early": (0.15, 0.45, 0.6, 0.55, 2.5),
    "creep": (0.3, 0.4, 0.7, 0.5, 1.2),
}
BASELINE_MOTION = "dwell"

# Given values. The hole is the cup and a margin; l, w, r, s of sections 1 and 2 lie on the straight
# line from hole to tube unless given.
DEFAULT_VALUES: Mapping[str, float] = {
    "s0": 0,
    "z1": -80, "z2": -180, "z3": -260,
    "l3": 95, "w3": 70, "r3": 25, "s3": 0,
    **dict(zip(MOTION_PARAMETERS, SIMPLE_MOTIONS[BASELINE_MOTION], strict=True)),
}  # fmt: skip
HOLE_MARGIN: Mapping[str, float] = {"l": 20, "w": 15, "r": 5}  # [mm] hole less cup: 150, 115, 25
DEFAULT_FREE: Mapping[str, Bounds] = {
    "l1": (80, 180), "w1": (60, 140), "r1": (5, 45), "s1": (-40, 40),
    "l2": (70, 150), "w2": (50, 120), "r2": (5, 40), "s2": (-30, 30),
    "x1": (0.05, 0.45), "y1": (0.1, 0.9), "x2": (0.55, 0.95), "y2": (0.1, 0.9), "v": (0.2, 4),
}  # fmt: skip

# Solid share of randomly packed grains at their densest: 0.64 for spheres, less for rods as long
# as grains of rice (Williams and Philipse, doi 10.1103/PhysRevE.67.051301).
DENSEST = 0.64
SHALLOWEST_MM = -1.0  # the tube's upper end below the plate; sections 1 and 2 lie in between


class CupSettings(Settings):
    """The dosing cup's inside; its height follows from the volume."""

    length_mm: Millimetres = 130
    width_mm: Millimetres = 100
    radius_mm: float = Field(20, ge=0, le=10_000)
    volume_ml: Millilitres = 1279


class DosingSettings(PortionSettings):
    """The dosing problem: machine, portion, materials, and which parameters are free."""

    varied: ClassVar[Mapping[str, tuple[float, ...]]] = {
        **PortionSettings.varied, "cycle_ms": (1.5,),
    }  # fmt: skip

    cup: CupSettings = CupSettings()
    stroke_mm: Millimetres = 400
    cycle_ms: Milliseconds = 600
    duration_ms: Milliseconds = 1200  # a run ends here at the latest
    tube_end_z_mm: DesignValue = -560
    # 1 kg of rice a cycle (paper, section 2.2). Mass and number of grains are kept, and the
    # grain's scale follows from them: 18 380 grains come out 1.24 times as large as a grain of
    # 7 mm x 2 mm. At the 1.5 times that the paper names they would be 1.1 l of solid rice, more
    # than a cup of 1279 ml can hold.
    portion_kg: Kilograms = 1.0
    grain_length_mm: Millimetres = 7
    grain_width_mm: Millimetres = 2
    grain: Annotated[MaterialSettings, completed_from(RICE)] = RICE
    wall: Annotated[MaterialSettings, completed_from(STEEL)] = STEEL
    free: dict[str, Bounds] = Field(default_factory=lambda: dict(DEFAULT_FREE), min_length=1)
    values: dict[str, DesignValue] = Field(default_factory=dict)

    @field_validator("free", "values")
    @classmethod
    def _known(cls, given: dict[str, object]) -> dict[str, object]:
        for name in given:
            if name not in PARAMETERS:
                raise ValueError(f"unknown design parameter {name!r}{nearest(name, PARAMETERS)}")
        return given

    @model_validator(mode="after")
    def _consistent(self) -> "DosingSettings":
        if self.duration_ms < self.cycle_ms:
            raise ValueError(
                f"duration_ms = {self.duration_ms:g} must be at least "
                f"cycle_ms = {self.cycle_ms:g}; lengthen the run"
            )
        if self.solid_fraction > DENSEST:
            least = 1e6 * self.portion_kg / self.grain.density_kg_m3 / DENSEST
            raise ValueError(
                f"portion_kg = {self.portion_kg:g} would fill the cup of "
                f"cup.volume_ml = {self.cup.volume_ml:g} to {self.solid_fraction:.0%} with solid "
                f"grains, and no poured portion is denser than {DENSEST:.0%}; give the cup at "
                f"least {math.ceil(least)} ml, or a lighter portion"
            )
        z3 = self.values.get("z3", DEFAULT_VALUES["z3"])
        if z3 > SHALLOWEST_MM:
            raise ValueError(
                f"values.z3 = {z3:g} must be at most {SHALLOWEST_MM:g}, below the plate at z = 0; "
                "lower it"
            )
        lowest = self.free["z3"][0] if "z3" in self.free else z3
        if self.tube_end_z_mm >= lowest:
            raise ValueError(
                f"tube_end_z_mm = {self.tube_end_z_mm:g} must lie below the tube's upper "
                f"end z3 = {lowest:g}; lower it"
            )
        return self

    @property
    def solid_fraction(self) -> float:
        """Volume of the portion's grains over that of the cup."""
        return 1e6 * self.portion_kg / self.grain.density_kg_m3 / self.cup.volume_ml

    @property
    def outlet_mm(self) -> float:
        """The smaller side of the tube."""
        values = self.all_values()
        return min(values["l3"], values["w3"])

    def all_values(self) -> dict[str, float]:
        """Value of every design parameter: the hole as the cup asks, straight from hole to tube.

        A free parameter's value is where the search starts: the baseline.
        """
        cup = {"l": self.cup.length_mm, "w": self.cup.width_mm, "r": self.cup.radius_mm}
        hole = {f"{letter}0": cup[letter] + HOLE_MARGIN[letter] for letter in "lwr"}
        values = {**hole, **DEFAULT_VALUES, **self.values}
        for i in (1, 2):
            share = values[f"z{i}"] / values["z3"]  # 0 at the hole, 1 at the tube
            for letter in "lwrs":
                upper, lower = values[f"{letter}0"], values[f"{letter}3"]
                values.setdefault(f"{letter}{i}", upper + share * (lower - upper))
        return values
