"""Engines refuse physics that they lack, before anything runs."""

from dataclasses import replace

import numpy as np
import pytest

from fidelity.engine import BodyForce, Engine, Material, Packing, Physics, Setup
from fidelity.engines.bullet.engine import BulletEngine
from fidelity.engines.refuse import refuse
from fidelity.engines.yade.engine import YadeEngine
from fidelity.grains.grain import line_grain
from mfopt.errors import ConfigError

JET = BodyForce((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (2.0, 0.0, 0.0))
MATERIAL = Material(1e6, 0.3, 0.4, 1400.0)
SETUP = Setup(
    grain=line_grain(0.004, 0.004, 1, 1400.0),
    packing=Packing(np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0, 0.0]])),
    grain_material=MATERIAL,
    walls=(),
    physics=Physics(),
    duration=0.001,
    exit_z=-1.0,
)
NEITHER_HAS = [
    ("rolling_friction", Physics(rolling_friction=0.1), "0.1"),
    ("rolling_stiffness", Physics(rolling_stiffness=2.0), "2.0"),
    ("body_forces", Physics(body_forces=(JET,)), "(BodyForce"),
]


@pytest.mark.parametrize(
    ("engine", "field", "physics", "value"),
    [(engine, *row) for engine in (YadeEngine(), BulletEngine()) for row in NEITHER_HAS]
    + [
        (YadeEngine(), "restitution", Physics(restitution=0.6), "0.6"),
        (YadeEngine(), "restitution", Physics(contact_law="hertz"), "None"),
        (YadeEngine(), "adhesion_energy", Physics(adhesion_energy=0.02), "0.02"),
        (BulletEngine(), "adhesion_energy", Physics(adhesion_energy=0.02), "0.02"),
        (BulletEngine(), "linear_drag", Physics(linear_drag=3.0), "3.0"),
        (BulletEngine(), "quadratic_drag", Physics(quadratic_drag=0.5), "0.5"),
        (BulletEngine(), "contact_law", Physics(contact_law="hertz", restitution=0.6), "'hertz'"),
    ],
)
def test_what_an_engine_lacks_is_refused_with_a_remedy(
    engine: Engine, field: str, physics: Physics, value: str
) -> None:
    with pytest.raises(ConfigError) as error:
        engine.move(replace(SETUP, physics=physics), time_limit_s=60.0)
    message = str(error.value)
    assert f"engine {engine.name}" in message
    assert f"{field} = {value}" in message
    assert "choose the engine numba" in message


@pytest.mark.parametrize("name", ["linear_drag", "quadratic_drag"])
def test_yade_refuses_drag_on_grains_of_several_spheres(name: str) -> None:
    long = line_grain(0.012, 0.004, 3, 1400.0)
    physics = replace(SETUP.physics, **{name: 0.5})  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match=rf"{name} = 0\.5 .* give the grains one sphere"):
        YadeEngine().move(replace(SETUP, grain=long, physics=physics), time_limit_s=60.0)


def test_physics_that_no_engine_names_is_refused() -> None:
    for name in ("linear_drag", "adhesion_energy", "rolling_friction"):
        with pytest.raises(ConfigError, match=f"{name} = 0.5"):
            refuse("any", Physics(**{name: 0.5}), has=("damping",))  # type: ignore[arg-type]


def test_absent_physics_is_no_reason_to_refuse() -> None:
    has = ("damping", "gravity")
    refuse("any", Physics(damping=0.5, gravity=1.6), has=has)
    with pytest.raises(ConfigError, match="set it to None"):
        refuse("any", Physics(restitution=0.5), has=has)
