"""Effects of the grains' sizes and shape, which act before a vessel is filled."""

import math
from dataclasses import replace

import numpy as np

from fidelity.effects.kinds import PortionEffect, Values
from fidelity.engine import Grain
from fidelity.grains.filling import Portion
from fidelity.grains.grain import portion_grain
from mfopt.errors import ConfigError
from mfopt.records.effect import Effect, EffectParameter

CLOSEST = 0.5  # [widths] neighbouring spheres of a stretched grain are at most so far apart
ALIKE = 1e-9  # [radii] spheres that differ by less are equal, and on the axis


def _mix(portion: Portion, values: Values) -> Portion:
    mixed = replace(
        portion.sizes, small_share=values["small_share"], small_ratio=values["small_ratio"]
    )
    return replace(portion, sizes=mixed)


def _stretch(portion: Portion, values: Values) -> Portion:
    """Longer grains of more spheres; spheres in nearly one place make contacts stiffer."""
    if not values["aspect"] >= 1.0:
        raise ConfigError(f"grain_aspect: aspect = {values['aspect']:g} must be at least 1")
    ratio = values["aspect"] * portion.grain_length / _width(portion.grain)
    grain = portion_grain(
        mass=portion.grain.mass,
        density=portion.grain_material.density,
        length=ratio,
        width=1.0,
        grains=1,
        spheres=max(len(portion.grain.radii), 1 + math.ceil((ratio - 1.0) / CLOSEST)),
    )
    return replace(portion, grain=grain)


def _width(grain: Grain) -> float:
    """Width of a grain of equal spheres in a line [m]."""
    radius = float(grain.radii.max())
    off_axis = np.abs(grain.offsets[:, 1:]).max()
    if max(off_axis, np.ptp(grain.radii)) > ALIKE * radius:
        raise ConfigError(
            f"grain_aspect: spheres lie up to {off_axis:g} m off the long axis or differ in "
            "radius; it stretches equal spheres in a line only"
        )
    return 2.0 * radius


TWO_SIZES = PortionEffect(
    Effect(
        "two_sizes",
        {
            "small_share": EffectParameter(0.0, 0.0, 1.0, "-", "small grains over all, by number"),
            "small_ratio": EffectParameter(1.0, 0.3, 1.0, "-", "size of small over large grains"),
        },
        "material",
        "mean of scale^3 is 1: number and mass of the grains stay",
        "definition",
    ),
    ("numba", "yade"),
    _mix,
)
GRAIN_ASPECT = PortionEffect(
    Effect(
        "grain_aspect",
        {"aspect": EffectParameter(1.0, 1.0, 4.0, "-", "factor on length over width")},
        "material",
        "spheres in a line, length / width = aspect times before, the same mass",
        "definition",
    ),
    ("numba", "yade"),
    _stretch,
)
