"""What scenes of the laboratory have in common: beads in a vessel of a few free measures."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import model_validator

from fidelity.effects.switch import with_effects
from fidelity.grains.filling import Portion
from fidelity.grains.grain import portion_grain
from fidelity.grains.settings import (
    MILLI,
    STEEL,
    DemSettings,
    MaterialSettings,
    completed_from,
)
from fidelity.grains.sizes import Sizes
from fidelity.scene import PortionSettings, Possible, drawn
from geometry.mesh import Mesh
from mfopt.arrays import Array, frozen
from mfopt.errors import ConfigError, InvalidDesign
from mfopt.limits import Kilograms, Millimetres, SizeScatter
from mfopt.records.problem import Problem, Variable
from mfopt.records.view import DesignView
from mfopt.settings import nearest

# Glass beads, softened for longer time steps.
BEADS = MaterialSettings(
    young_modulus_pa=5e6, poisson_ratio=0.25, density_kg_m3=2500, friction_angle_deg=20
)


class Vessel(PortionSettings):
    """A vessel, the grains in it, and which of its measures are free."""

    units: ClassVar[Mapping[str, str]]  # of every measure that can be free
    usual_step: ClassVar[float | None] = None  # see `DemSettings.physics`

    portion_kg: Kilograms = 0.25
    grain_length_mm: Millimetres = 5
    grain_width_mm: Millimetres = 5
    size_scatter: SizeScatter = 0.0  # half width of an even distribution, over the mean size
    grain: Annotated[MaterialSettings, completed_from(BEADS)] = BEADS
    wall: Annotated[MaterialSettings, completed_from(STEEL)] = STEEL

    @model_validator(mode="after")
    def _known(self) -> "Vessel":
        for name in self.free:
            if name not in self.units:
                raise ValueError(f"free: unknown measure {name!r}{nearest(name, self.units)}")
        return self

    def values_at(self, x: Array) -> dict[str, float]:
        """Value of every measure at the design `x` (d,)."""
        return {**self.all_values(), **dict(zip(self.free, map(float, x), strict=True))}

    def portion(self, dem: DemSettings) -> Portion:
        """The grains, as finely as a level resolves them, with its effects on grains."""
        grain = portion_grain(
            mass=self.portion_kg,
            density=self.grain.density_kg_m3,
            length=MILLI * self.grain_length_mm,
            width=MILLI * self.grain_width_mm,
            grains=dem.grains,
            spheres=dem.spheres_per_grain,
        )
        portion = Portion(
            grain,
            dem.grains,
            self.grain.material(dem.young_modulus_pa),
            self.wall.material(),
            dem.physics(self.usual_step),
            Sizes(self.size_scatter),
            self.wall_friction_angle,
        )
        return with_effects(portion, dem.effects)


class VesselScene:
    """What scenes of a vessel of beads do alike; each is a `fidelity.scene.Scene`."""

    __slots__ = ()
    name: ClassVar[str]
    settings: Vessel

    def starts(self, problem: Problem) -> Mapping[str, Array]:
        """The vessel as it is given."""
        return {"baseline": problem.baseline}

    def portion(self, x: Array, dem: DemSettings) -> Portion:
        """The grains in the vessel."""
        return self.settings.portion(dem)

    def reduced(self, name: str, grains: int) -> None:
        """There is no analytic model."""

    def meshes(self, x: Array) -> Mapping[str, Mesh]:
        """The parts of the vessel."""
        raise NotImplementedError

    def view(self, x: Array, dem: DemSettings | None) -> DesignView:
        """The vessel, and the grains of the target level."""
        grain = None if dem is None else self.portion(x, dem).grain
        return drawn(x, self.meshes(x), grain)

    def write_step(self, x: Array, directory: Path) -> str:
        """There is no STEP file of plain plates and tubes.

        Raises:
            ConfigError: always; the parts are in the STL files.
        """
        raise ConfigError(
            f"the scene {self.name} writes no STEP file; its parts are in the STL files"
        )


def problem_of(
    settings: Vessel, build: Callable[[Any, Array], object], objective_unit: str = "-"
) -> Problem:
    """The free measures as variables; their values in the settings are the baseline.

    Raises:
        ConfigError: if the baseline is out of bounds or impossible.
    """
    variables = tuple(
        Variable(name, low, high, settings.units[name])
        for name, (low, high) in settings.free.items()
    )
    values = settings.all_values()
    baseline = frozen([values[name] for name in settings.free])
    constraint = Possible(settings, build)
    return Problem(variables, baseline, constraint, objective_unit=objective_unit)


def checked_design(check: Callable[[], None]) -> None:
    """Call the check of a scene; what it refuses is an impossible design.

    Raises:
        InvalidDesign: if it refuses.
    """
    try:
        check()
    except ConfigError as error:
        raise InvalidDesign(str(error)) from error
