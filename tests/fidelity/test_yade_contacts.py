"""Contacts in YADE: stiffness of both laws, and the restitution of Hertz's."""

import math
import shutil
from dataclasses import replace

import numpy as np
import pytest
from yade_scenes import BOXED, DENSITY, LIMIT_S, MATERIAL, SMOOTH, G, R, box, rice, single

from fidelity.engine import Grain, Packing, Physics, Wall
from fidelity.engines.yade.engine import YadeEngine
from fidelity.grains.grain import line_grain

needs_yade = pytest.mark.skipif(
    shutil.which("yade") is None, reason="YADE is not installed (apt-get install yade)"
)
pytestmark = [pytest.mark.yade, needs_yade]


def test_overlap_with_a_wall_is_weight_over_stiffness() -> None:
    # YADE gives a wall's side of the contact twice the sphere's radius: k_n = 4/3 E r.
    mass = 0.02
    overlap = mass * G / (4 / 3 * MATERIAL.young_modulus * R)
    grain = Grain(np.zeros((1, 3)), np.array([R]), mass, np.full(3, 0.4 * mass * R**2))
    packing = single(0.001, 0.002, R - overlap)
    undamped = Physics(damping=0.0)  # damping allows any force within its own range at rest
    setup = replace(BOXED, grain=grain, packing=packing, physics=undamped, duration=0.02)
    movement = YadeEngine().move(setup, time_limit_s=LIMIT_S)
    assert movement.max_overlap == pytest.approx(overlap / R, rel=1e-3)
    assert movement.max_kinetic_energy < 1e-9


# With steps of 0.6 the step in which the spheres meet changes the bounce by up to 3 %.
HERTZ = Physics(contact_law="hertz", restitution=0.6, damping=0.0, gravity=0.0, timestep_factor=0.1)
STEEL = replace(MATERIAL, young_modulus=1e8, friction_angle=0.0)


def bounce(physics: Physics, *, grain: Grain, edge: float, packing: Packing) -> tuple[float, float]:
    """Speeds [m/s], along z after 0.5 m/s downwards and about y [rad/s], over x > `edge` [m]."""
    plate = Wall(
        "plate",
        np.array([(edge, -0.1, 0.0), (0.3, -0.1, 0.0), (0.3, 0.1, 0.0), (edge, 0.1, 0.0)]),
        np.array([(0, 1, 2), (0, 2, 3)]),
        STEEL,
    )
    setup = replace(
        BOXED,
        grain=grain,
        packing=packing,
        walls=(plate,),
        grain_material=replace(SMOOTH, young_modulus=1e7),
        physics=physics,
        velocities=np.array([[0.0, 0.0, -0.5]]),
        duration=1.4e-3,
    )
    movement = YadeEngine().move(setup, time_limit_s=LIMIT_S)
    assert movement.status == "finished", movement.why
    return float(movement.velocities[0, 2]), float(movement.angular_velocities[0, 1])


@pytest.mark.parametrize("restitution", [0.3, 0.6, 0.9])
def test_hertzian_contact_with_a_wall_returns_the_restitution(restitution: float) -> None:
    physics = replace(HERTZ, restitution=restitution)
    ball = line_grain(2 * R, 2 * R, 1, DENSITY)
    back, _ = bounce(physics, grain=ball, edge=-0.3, packing=single(0.01, 0.02, 1.02 * R))
    assert back == pytest.approx(0.5 * restitution, rel=0.01)
    # Pushed at its end alone, a grain turns too: the end returns the restitution.
    high = single(0.0, 0.0, 1.02 * R)
    back, turn = bounce(physics, grain=rice(), edge=1.9 * R, packing=high)
    assert abs(turn) > 10.0
    assert back - 2.5 * R * turn == pytest.approx(0.5 * restitution, rel=0.01)


def test_hertzian_contact_of_two_spheres_returns_the_restitution_whatever_their_sizes() -> None:
    places = np.array([[0.0, 0.0, 0.1], [0.0, 2.55 * R, 0.1]])
    packing = Packing(places, np.tile([1.0, 0.0, 0.0, 0.0], (2, 1)), np.array([1.0, 1.5]))
    setup = replace(
        BOXED,
        grain=line_grain(2 * R, 2 * R, 1, DENSITY),
        packing=packing,
        walls=(),
        physics=HERTZ,
        velocities=np.array([[0.0, 0.3, 0.0], [0.0, -0.2, 0.0]]),
        duration=4e-3,
    )
    movement = YadeEngine().move(setup, time_limit_s=LIMIT_S)
    one, two = movement.velocities[:, 1]
    assert two - one == pytest.approx(0.6 * 0.5, rel=0.01)
    assert one + 1.5**3 * two == pytest.approx(0.3 - 1.5**3 * 0.2, rel=1e-6)


def test_hertzian_overlap_with_a_wall_carries_the_weight() -> None:
    # Hertz: m g = 4/3 E* sqrt(R*) d^1.5. YADE gives a wall's side of the contact twice the
    # sphere's radius, so that R* is not r but 2/3 r.
    mass = 0.02
    materials = ((MATERIAL.young_modulus, 0.3), (STEEL.young_modulus, 0.3))
    e_star = 1 / sum((1 - nu**2) / e for e, nu in materials)
    overlap = (mass * G / (4 / 3 * e_star * math.sqrt(2 / 3 * R))) ** (2 / 3)
    setup = replace(
        BOXED,
        grain=Grain(np.zeros((1, 3)), np.array([R]), mass, np.full(3, 0.4 * mass * R**2)),
        packing=single(0.001, 0.002, R - overlap),
        walls=(replace(box(), material=STEEL),),
        physics=replace(HERTZ, gravity=G),
        duration=0.05,
    )
    movement = YadeEngine().move(setup, time_limit_s=LIMIT_S)
    assert movement.max_overlap == pytest.approx(overlap / R, rel=2e-3)
    assert movement.positions[0, 2] == pytest.approx(R - overlap, rel=1e-4)
