"""Settings of the discharge scene, as a study file gives them; units are in the names."""

import math
from collections.abc import Mapping
from typing import ClassVar

from pydantic import Field, model_validator

from fidelity.grains.settings import MILLI
from fidelity.scenes.beads import Vessel, checked_design
from fidelity.scenes.discharge.run import DischargeSettings, check_discharge
from mfopt.arrays import Array
from mfopt.limits import Bounds, Degrees, Millimetres, Milliseconds


class Hopper(Vessel):
    """A hopper of rectangular section."""

    units: ClassVar[Mapping[str, str]] = {
        "opening": "mm", "opening_depth": "mm", "floor_angle": "deg", "length": "mm",
        "depth": "mm",
    }  # fmt: skip
    varied: ClassVar[Mapping[str, tuple[float, ...]]] = {
        **Vessel.varied, "opening_mm": (0.8, 1.4),
    }  # fmt: skip

    length_mm: Millimetres = 120  # of the box along x
    depth_mm: Millimetres = 30  # along y
    opening_mm: Millimetres = 30  # of the outlet along x
    opening_depth_mm: Millimetres | None = None  # along y; None: a slot, all the depth
    floor_angle_deg: Degrees = 0.0  # of the floor to the horizontal; 0: flat bottom
    floor_mm: float = Field(default=0.0, ge=0.0, le=1000.0)  # thickness; the outlet is below
    bar_mm: Millimetres | None = None  # diameter of a bar across the hopper; None: there is none
    bar_height_mm: Millimetres = 50  # of the bar's axis above the outlet
    fall_mm: Millimetres = 35  # from the outlet down to where grains are counted
    duration_ms: Milliseconds = 1500
    samples: int = Field(default=100, ge=1, le=10_000)  # moments of the quantities over time
    free: dict[str, Bounds] = Field(
        default_factory=lambda: {"opening": (20.0, 60.0), "floor_angle": (0.0, 70.0)}, min_length=1
    )

    @model_validator(mode="after")
    def _has_depth(self) -> "Hopper":
        if "opening_depth" in self.free and self.opening_depth_mm is None:
            raise ValueError(
                "free.opening_depth needs a value of opening_depth_mm to start from; give one"
            )
        return self

    @property
    def outlet_mm(self) -> float:
        """The smaller side of the outlet."""
        values = self.all_values()
        return min(values["opening"], values["opening_depth"])

    def all_values(self) -> dict[str, float]:
        """Value of every measure that can be free [mm, deg]."""
        depth = self.depth_mm if self.opening_depth_mm is None else self.opening_depth_mm
        return {
            "length": self.length_mm,
            "depth": self.depth_mm,
            "opening": self.opening_mm,
            "opening_depth": depth,
            "floor_angle": self.floor_angle_deg,
        }


def built(settings: Hopper, x: Array) -> DischargeSettings:
    """The hopper of the design `x` (d,) [mm, deg], in SI units.

    Raises:
        InvalidDesign: if it cannot be built.
    """
    values, slot = settings.values_at(x), settings.opening_depth_mm is None
    hopper = DischargeSettings(
        length=MILLI * values["length"],
        depth=MILLI * values["depth"],
        opening=MILLI * values["opening"],
        opening_depth=None if slot else MILLI * values["opening_depth"],
        floor_angle=math.radians(values["floor_angle"]),
        floor=MILLI * settings.floor_mm,
        bar=0.0 if settings.bar_mm is None else MILLI * settings.bar_mm,
        bar_height=MILLI * settings.bar_height_mm,
        fall=MILLI * settings.fall_mm,
        duration=MILLI * settings.duration_ms,
    )
    checked_design(lambda: check_discharge(hopper))
    return hopper
