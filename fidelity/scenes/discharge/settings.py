"""Settings of the discharge scene, as a study file gives them; units are in the names."""

import math
from typing import Annotated

from pydantic import Field, Strict, model_validator

from fidelity.grains.settings import STEEL, MaterialSettings
from fidelity.scenes.beads import BEADS
from fidelity.scenes.discharge.run import DischargeSettings
from mfopt.limits import Degrees, DesignValue, Kilograms, Millimetres, Milliseconds
from mfopt.settings import Settings, nearest

MILLI = 1e-3
Bounds = Annotated[tuple[DesignValue, DesignValue], Strict(False)]  # TOML gives a list
UNITS = {"opening": "mm", "opening_depth": "mm", "floor_angle": "deg", "length": "mm",
         "depth": "mm"}  # fmt: skip


class Hopper(Settings):
    """A hopper of rectangular section, what is in it, and which of its measures are free."""

    length_mm: Millimetres = 120  # of the box along x
    depth_mm: Millimetres = 30  # along y
    opening_mm: Millimetres = 30  # of the outlet along x
    opening_depth_mm: Millimetres | None = None  # along y; None: a slot, all the depth
    floor_angle_deg: Degrees = 0.0  # of the floor to the horizontal; 0: flat bottom
    floor_mm: float = Field(default=0.0, ge=0.0, le=1000.0)  # thickness; the outlet is below
    fall_mm: Millimetres = 35  # from the outlet down to where grains are counted
    duration_ms: Milliseconds = 1500
    samples: int = Field(default=100, ge=1, le=10_000)  # moments of the quantities over time
    portion_kg: Kilograms = 0.25
    grain_length_mm: Millimetres = 5
    grain_width_mm: Millimetres = 5
    grain: MaterialSettings = BEADS
    wall: MaterialSettings = STEEL
    free: dict[str, Bounds] = Field(
        default_factory=lambda: {"opening": (20.0, 60.0), "floor_angle": (0.0, 70.0)}, min_length=1
    )

    @model_validator(mode="after")
    def _known(self) -> "Hopper":
        for name in self.free:
            if name not in UNITS:
                raise ValueError(f"free: unknown measure {name!r}{nearest(name, UNITS)}")
        if "opening_depth" in self.free and self.opening_depth_mm is None:
            raise ValueError(
                "free.opening_depth needs a value of opening_depth_mm to start from; give one"
            )
        if self.grain_length_mm < self.grain_width_mm:
            raise ValueError(
                f"grain_length_mm = {self.grain_length_mm:g} must be at least "
                f"grain_width_mm = {self.grain_width_mm:g}; exchange them"
            )
        return self

    def values(self) -> dict[str, float]:
        """Value of every measure that can be free [mm, deg]."""
        depth = self.depth_mm if self.opening_depth_mm is None else self.opening_depth_mm
        return {
            "length": self.length_mm,
            "depth": self.depth_mm,
            "opening": self.opening_mm,
            "opening_depth": depth,
            "floor_angle": self.floor_angle_deg,
        }

    def built(self, values: dict[str, float]) -> DischargeSettings:
        """The hopper with these measures [mm, deg], in SI units."""
        slot = self.opening_depth_mm is None
        return DischargeSettings(
            length=MILLI * values["length"],
            depth=MILLI * values["depth"],
            opening=MILLI * values["opening"],
            opening_depth=None if slot else MILLI * values["opening_depth"],
            floor_angle=math.radians(values["floor_angle"]),
            floor=MILLI * self.floor_mm,
            fall=MILLI * self.fall_mm,
            duration=MILLI * self.duration_ms,
        )
