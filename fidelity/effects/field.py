"""Effects that act on every grain wherever it is: drag, body damping, a tilted rig."""

import math
from dataclasses import replace

from fidelity.effects.kinds import SetupEffect, Values
from fidelity.engine import Setup
from mfopt.errors import ConfigError
from mfopt.records.effect import Effect, EffectParameter


def _drag_linearly(setup: Setup, values: Values) -> Setup:
    rate = setup.physics.linear_drag + values["rate"]
    return replace(setup, physics=replace(setup.physics, linear_drag=rate))


def _drag_quadratically(setup: Setup, values: Values) -> Setup:
    rate = setup.physics.quadratic_drag + values["rate"]
    return replace(setup, physics=replace(setup.physics, quadratic_drag=rate))


def _damp(setup: Setup, values: Values) -> Setup:
    share = values["share"]
    if not 0.0 < share < 1.0:
        raise ConfigError(f"body_damping: share = {share:g} must be at least 0 and below 1")
    if setup.physics.damping != 0.0:
        raise ConfigError(
            f"body_damping: the setup has a numerical damping = {setup.physics.damping:g} of its "
            "own, to which no share can be added; set it to 0 and give a restitution"
        )
    return replace(setup, physics=replace(setup.physics, damping=share, damp_gravity=True))


def _tilt(setup: Setup, values: Values) -> Setup:
    angle, azimuth = values["angle"], values["azimuth"]
    aside = math.sin(angle)
    direction = (aside * math.cos(azimuth), aside * math.sin(azimuth), -math.cos(angle))
    return replace(setup, physics=replace(setup.physics, gravity_direction=direction))


DRAG_LINEAR = SetupEffect(
    Effect(
        "drag_linear",
        {"rate": EffectParameter(0.0, 0.0, 20.0, "1/s", "deceleration over speed")},
        "material",
        "dv/dt = g - rate v / scale^2, ends in g / rate",
        "Stokes 1851: rate = 18 viscosity / (density diameter^2)",
    ),
    ("numba", "yade"),
    _drag_linearly,
)
DRAG_QUADRATIC = SetupEffect(
    Effect(
        "drag_quadratic",
        {"rate": EffectParameter(0.0, 0.0, 10.0, "1/m", "deceleration over squared speed")},
        "material",
        "dv/dt = g - rate |v| v / scale, ends in sqrt(g / rate)",
        "Newton's drag: rate = 3/4 C_d air density / (grain density diameter)",
    ),
    ("numba", "yade"),
    _drag_quadratically,
)
BODY_DAMPING = SetupEffect(
    Effect(
        "body_damping",
        {"share": EffectParameter(0.0, 0.0, 0.5, "-", "of each component of force and weight")},
        "numerics",
        "F_c -> F_c (1 - share sign(F_c v_c)), weight included; free fall with (1 - share) g",
        "Cundall 1987, numerical damping as in YADE's NewtonIntegrator with dampGravity",
    ),
    ("numba", "yade"),
    _damp,
    fills=False,
)
TILT = SetupEffect(
    Effect(
        "tilt",
        {
            "angle": EffectParameter(0.0, -0.2, 0.2, "rad", "between gravity and -z"),
            "azimuth": EffectParameter(
                0.0, -math.pi, math.pi, "rad", "of where the grains are pulled, from x to y",
                shapes=True,
            ),
        },
        "apparatus",
        "g (sin(angle) cos(azimuth), sin(angle) sin(azimuth), -cos(angle))",
        "definition",
    ),
    ("numba", "yade"),
    _tilt,
)  # fmt: skip
