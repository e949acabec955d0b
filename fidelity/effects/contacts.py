"""Effects in the contacts of grains: rolling resistance, cohesion, restitution, a rougher side."""

import math
from dataclasses import replace

import numpy as np

from fidelity.effects.kinds import SetupEffect, Values
from fidelity.engine import Setup, Wall
from mfopt.arrays import BoolArray
from mfopt.errors import ConfigError
from mfopt.records.effect import Effect, EffectParameter

FLAT = 1e-9  # [m] corners this close to the plane of the front side lie in it


def _roll(setup: Setup, values: Values) -> Setup:
    physics, more = setup.physics, values["coefficient"]
    return replace(
        setup,
        physics=replace(
            physics,
            rolling_friction=physics.rolling_friction + more,
            rolling_stiffness=physics.rolling_stiffness * values["spring"],
        ),
    )


def _stick(setup: Setup, values: Values) -> Setup:
    energy = setup.physics.adhesion_energy + values["energy"]
    return replace(setup, physics=replace(setup.physics, adhesion_energy=energy))


def _bounce(setup: Setup, values: Values) -> Setup:
    before = setup.physics.restitution
    after = (1.0 if before is None else before) + values["change"]
    if not 0.0 < after <= 1.0:
        raise ConfigError(
            f"restitution: change = {values['change']:g} makes {after:g}, which must lie above 0 "
            "and at most at 1; choose a change nearer to 0"
        )
    return replace(setup, physics=replace(setup.physics, restitution=after))


def _roughen(setup: Setup, values: Values) -> Setup:
    """The side is a wall of its own after all others, unless a wall lies in it as a whole."""
    front = min(float(wall.vertices[:, 1].min()) for wall in setup.walls)
    if not any(_at(wall, front).any() for wall in setup.walls):
        raise ConfigError(
            f"side_wall_friction: no wall is flat at the smallest y = {front:g} m; "
            "use a vessel with a flat side there"
        )
    walls, sides = [], []
    for wall in setup.walls:
        there = _at(wall, front)
        if not there.any():
            walls.append(wall)
            continue
        rough = replace(wall, friction_angle=_rougher(setup, wall, values["excess"]))
        if there.all():
            walls.append(rough)
            continue
        triangles, name = wall.triangles, f"{wall.name} front"
        walls.append(replace(wall, triangles=triangles[~there]))
        sides.append(replace(rough, name=name, triangles=triangles[there]))
    return replace(setup, walls=(*walls, *sides))


def _at(wall: Wall, y: float) -> BoolArray:
    """Which triangles (t,) of the wall lie in the plane at `y` [m]."""
    return np.asarray((np.abs(wall.vertices[wall.triangles][..., 1] - y) < FLAT).all(axis=1))


def _rougher(setup: Setup, wall: Wall, excess: float) -> float:
    angle = wall.friction_angle
    if angle is None:
        angle = min(setup.grain_material.friction_angle, wall.material.friction_angle)
    coefficient = math.tan(angle) + excess
    if coefficient < 0.0:
        raise ConfigError(
            f"side_wall_friction: excess = {excess:g} must be at least {-math.tan(angle):g}, which "
            "leaves no friction"
        )
    return math.atan(coefficient)


ROLLING_RESISTANCE = SetupEffect(
    Effect(
        "rolling_resistance",
        {
            "coefficient": EffectParameter(
                0.0, 0.0, 0.5, "-", "largest rolling moment over pressing force and R*"
            ),
            "spring": EffectParameter(
                1.0, 0.01, 10.0, "-", "stiffness of the rolling spring over kt R*^2", shapes=True
            ),
        },
        "material",
        "dM = -spring kt R*^2 (w_i - w_j) dt, |M| <= coefficient R* N",
        "Ai, Chen, Rotter & Ooi 2011, doi:10.1016/j.powtec.2010.09.030, type C",
    ),
    ("numba",),
    _roll,
)
COHESION = SetupEffect(
    Effect(
        "cohesion",
        {"energy": EffectParameter(0.0, 0.0, 0.5, "J/m2", "work of adhesion")},
        "material",
        "a pull of 2 pi R* energy in each contact",
        "Derjaguin, Muller & Toporov 1975, doi:10.1016/0021-9797(75)90018-1",
    ),
    ("numba", "yade"),
    _stick,
)
RESTITUTION = SetupEffect(
    Effect(
        "restitution",
        {"change": EffectParameter(0.0, -0.6, 0.3, "-", "added to the coefficient of restitution")},
        "material",
        "speed after over speed before a bounce = restitution + change",
        "Schwager & Poeschel 2007, doi:10.1007/s10035-007-0065-z",
    ),
    ("numba", "yade"),
    _bounce,
)
SIDE_WALL_FRICTION = SetupEffect(
    Effect(
        "side_wall_friction",
        {
            "excess": EffectParameter(
                0.0, -0.3, 1.0, "-", "added to the friction coefficient of the side at smallest y"
            )
        },
        "apparatus",
        "|T| <= (tan(friction_angle) + excess) N on that side",
        "Coulomb friction; Janssen 1895 for what a side carries",
    ),
    ("numba", "yade"),
    _roughen,
)
