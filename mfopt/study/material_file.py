"""The material file: calibrated values, and what they hold for. Read, checked, written as TOML."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from fidelity.effects.switch import effect_named
from fidelity.engine import ContactLaw
from fidelity.rig import PARAMETERS, effect_parameter
from mfopt.errors import ConfigError
from mfopt.files.toml_text import toml_tables, toml_text
from mfopt.limits import (
    Damping,
    Density,
    Millimetres,
    Modulus,
    Name,
    Restitution,
    SizeScatter,
    SpheresPerGrain,
)
from mfopt.records.effect import complete
from mfopt.settings import Settings, checked

Friction = Annotated[float, Field(ge=0.0, le=57.0)]  # [-] 57 is an angle of 89 degrees
ModulusRange = Annotated[tuple[Modulus, Modulus], Field(strict=False)]  # TOML gives a list


class ValueSettings(Settings):
    """One calibrated parameter, in the unit that is named."""

    value: float  # mean of the posterior
    low: float  # of the 90 % interval
    high: float
    unit: str
    determined: bool  # whether the recordings say something of it

    @model_validator(mode="after")
    def _ordered(self) -> "ValueSettings":
        if self.low > self.high:
            raise ValueError(f"low = {self.low:g} must be at most high = {self.high:g}; swap them")
        return self


class HeldSettings(Settings):
    """The simulations that the values come from."""

    contact_law: ContactLaw
    damping: Damping
    damp_gravity: bool
    restitution: Restitution | None = None
    young_modulus_pa: ModulusRange  # of the simulated grains, from and to
    friction: Friction  # between grains
    wall_friction: Friction  # of grains on walls
    density_kg_m3: Density
    grain_length_mm: Millimetres  # of the simulated grains
    grain_width_mm: Millimetres
    spheres_per_grain: SpheresPerGrain
    size_scatter: SizeScatter
    coarse: float = Field(ge=1.0)  # diameter of the simulated grains over the real one
    engine: Name
    effects: dict[str, dict[str, float]] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _ordered(self) -> "HeldSettings":
        low, high = self.young_modulus_pa
        if low > high:
            raise ValueError(
                f"young_modulus_pa = [{low:g}, {high:g}] must go from a smaller to a larger value; "
                "swap them"
            )
        if self.grain_length_mm < self.grain_width_mm:
            raise ValueError(
                f"grain_length_mm = {self.grain_length_mm:g} must be at least "
                f"grain_width_mm = {self.grain_width_mm:g}; exchange them"
            )
        return self


class _Limits(Settings):
    """What the parameters of `fidelity.rig` can be."""

    friction: Friction = 0.0
    wall_friction: Friction = 0.0
    restitution: Restitution = 1.0
    damping: Damping = 0.0
    young_modulus: Modulus = 1e6


class MaterialSettings(Settings):
    """A whole material file."""

    format: Literal[1]
    case: Name  # of the calibration
    recordings: list[Name] = Field(min_length=1)  # that were fitted
    fits: bool
    probability: float = Field(ge=0.0, le=1.0)  # of a larger misfit if the simulation is right
    values: dict[str, ValueSettings] = Field(min_length=1)
    holds_for: HeldSettings


def read_material(path: Path) -> MaterialSettings:
    """Read a material file.

    Raises:
        ConfigError: if it cannot be read, is not TOML, or has a wrong, unknown or missing key.
    """
    text = toml_text(path, "material file", "`mfopt calibrate` writes one into its run directory")
    return material_of_tables(toml_tables(text, str(path)), where=str(path))


def material_of_tables(tables: Mapping[str, Any], *, where: str) -> MaterialSettings:
    """The material that tables describe.

    Raises:
        ConfigError: if a key is wrong, or a parameter is unknown or out of range.
    """
    its = checked(MaterialSettings, tables, where=where)
    for name, found in its.values.items():
        _check_value(name, found, where)
    return its


def _check_value(name: str, found: ValueSettings, where: str) -> None:
    if name in PARAMETERS:
        checked(_Limits, {name: found.value}, where=f"{where}: values")
        return
    try:
        effect, its = effect_parameter(name)
        complete(effect_named(effect).effect, {its: found.value})
    except ConfigError as error:
        raise ConfigError(f"{where}: values: {error}") from error
    if name != f"{effect}.{its}":
        raise ConfigError(f'{where}: values: write [values."{effect}.{its}"] instead of {name!r}')


def material_text(its: MaterialSettings) -> str:
    """The material as commented TOML."""
    lines = [
        f"# Material of the calibration {its.case}, written by mfopt calibrate. A study takes it",
        '# with material = "material.toml" at its top. docs/calibration/material.md explains it.',
        "format = 1",
        f"case = {_shown(its.case)}",
        f"recordings = {_shown(its.recordings)}  # that were fitted",
        f"fits = {_shown(its.fits)}  # false: the simulation does not fit the recordings",
        f"probability = {_shown(its.probability)}  # of a larger misfit if all is right",
        "",
        "# Mean and 90 % interval. Not determined: the recordings hardly tell the value.",
    ]
    for name, found in its.values.items():
        key = name if name.isidentifier() else _shown(name)
        lines += [f"[values.{key}]", *_keys(found.model_dump()), ""]
    held = its.holds_for.model_dump(exclude={"effects"}, exclude_none=True)
    lines += [
        "# The simulations that the values come from. A study must agree with them.",
        "[holds_for]",
        *_keys(held, {name: COMMENTS[name] for name in held if name in COMMENTS}),
    ]
    for name, values in its.holds_for.effects.items():
        lines += ["", f"[holds_for.effects.{name}]", *_keys(values)]
    return "\n".join(lines) + "\n"


COMMENTS: Mapping[str, str] = {
    "damping": "numerical",
    "young_modulus_pa": "of the simulated grains, from and to",
    "friction": "coefficient between grains",
    "wall_friction": "coefficient of grains on walls",
    "grain_length_mm": "of the simulated grains",
    "size_scatter": "half width of the sizes over the mean size",
    "coarse": "diameter of the simulated grains over the real one; not compared",
    "engine": "another one gives a warning",
}


def _keys(values: Mapping[str, Any], comments: Mapping[str, str] | None = None) -> list[str]:
    said = comments or {}
    return [
        f"{name} = {_shown(value)}" + (f"  # {said[name]}" if name in said else "")
        for name, value in values.items()
    ]


def _shown(value: Any) -> str:
    """A value as TOML; six digits of a number."""
    match value:
        case bool():
            return "true" if value else "false"
        case float():
            return repr(float(f"{value:.6g}"))
        case list() | tuple():
            return f"[{', '.join(map(_shown, value))}]"
        case _:
            return json.dumps(value, ensure_ascii=False)
