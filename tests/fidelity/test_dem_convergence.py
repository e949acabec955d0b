"""The time step of the compiled engine: stability, and the order of convergence."""

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.engine.small_scenes import (
    LIMIT_S,
    YOUNG,
    G,
    R,
    Start,
    leaning,
    material,
    moved,
    off,
    plane,
    scene,
    sled,
    spheres_in_line,
    stable_step,
    still,
    wall_stiffness,
)
from fidelity.dem.law import law_of
from fidelity.dem.timestep import stable_timestep
from fidelity.engine import ContactLaw, Grain, Movement, Physics, Setup
from fidelity.engines.numba import NumbaEngine
from mfopt.errors import ConfigError

PRESS = 100.0  # [m/s2]


def pressed(physics: Physics) -> Setup:
    """A sphere pressed onto a plane, a hundredth of its overlap off its equilibrium."""
    grain = spheres_in_line(1)
    overlap = grain.mass * PRESS / wall_stiffness()
    start = Start((0.0, 0.0, R - 0.99 * overlap))
    return scene(grain, [start], plane(), physics=replace(physics, gravity=PRESS), duration=0.2)


def largest_excursion(setup: Setup, step: float) -> float:
    """Largest kinetic energy seen, over that of the free oscillation."""
    movement = NumbaEngine(fixed_timestep=step).move(setup, time_limit_s=LIMIT_S)
    overlap = setup.grain.mass * PRESS / wall_stiffness()
    return movement.max_kinetic_energy / (0.5 * wall_stiffness() * (0.01 * overlap) ** 2)


@pytest.mark.parametrize("restitution", [None, 0.7, 0.2])
def test_a_pressed_sphere_is_stable_up_to_the_step_that_is_stated(
    restitution: float | None,
) -> None:
    # On the spring of one contact: dt = 2 sqrt(m / k) / sqrt(1 + 2 zeta).
    setup = pressed(still(restitution=restitution))
    zeta = law_of(setup.physics).zeta
    limit = 2 * math.sqrt(setup.grain.mass / wall_stiffness() / (1 + 2 * zeta))
    assert largest_excursion(setup, 0.95 * limit) < 10.0  # near the limit it beats
    assert largest_excursion(setup, 1.05 * limit) > 100.0


def test_the_stable_step_of_a_sphere_is_that_of_its_hardest_motion() -> None:
    # Free to turn, it is held tangentially by kt at m / (1 + m R^2 / I) = 2/7 m.
    sphere, stuff = spheres_in_line(1), material(0.5)
    # Harder than a wall of its own material is another sphere: E R, and both give way.
    normal = 2 * math.sqrt(sphere.mass / (2 * YOUNG * R))
    assert stable_timestep(sphere, stuff, stuff, still()) == pytest.approx(
        min(normal, normal / math.sqrt(0.3 * 3.5)), rel=1e-9
    )


def test_the_stable_step_counts_the_turning_of_a_clump() -> None:
    # A push at its end, square to it, moves 1 / (1/m + b^2/I).
    grain, stuff = spheres_in_line(5), material()
    b = 2.5 * R
    inverse = 1 / grain.mass + b**2 / grain.inertia[1]
    slide = inverse + R**2 / grain.inertia[0]
    rate = 2 * YOUNG * R * max(inverse, 0.3 * slide)
    assert stable_timestep(grain, stuff, stuff, still()) == pytest.approx(2 / math.sqrt(rate))


@pytest.mark.parametrize(("scale", "power"), [(2.0, 1.0), (0.5, 1.0)])
def test_the_stable_step_grows_with_the_size(scale: float, power: float) -> None:
    # sqrt(m / k) goes with sqrt(R^3 / R) = R for both laws; with 1 / sqrt(E), too.
    grain, stuff, hard = spheres_in_line(3), material(), material(young=100 * YOUNG)
    larger = Grain(
        scale * grain.offsets, scale * grain.radii, scale**3 * grain.mass, scale**5 * grain.inertia
    )
    laws: tuple[ContactLaw, ...] = ("linear", "hertz")
    for law in laws:
        physics = still(contact_law=law)
        step = stable_timestep(grain, stuff, stuff, physics)
        assert stable_timestep(larger, stuff, stuff, physics) == pytest.approx(step * scale**power)
        assert stable_timestep(grain, hard, hard, physics) == pytest.approx(step / 10)


def end(setup: Setup, step: float) -> Movement:
    movement = NumbaEngine(fixed_timestep=step).move(setup, time_limit_s=LIMIT_S)
    assert movement.status == "finished", movement.why
    return movement


def test_an_oscillation_converges_with_the_square_of_the_step() -> None:
    # While a contact lasts nothing is cut off: leapfrog's own order shows.
    setup = pressed(still())
    rate = math.sqrt(wall_stiffness() / setup.grain.mass)
    overlap = PRESS / rate**2
    duration = 20.25 * 2 * math.pi / rate
    setup = replace(setup, duration=duration)
    errors = []
    for steps in (2000, 4000):
        movement = end(setup, duration / steps)
        place = movement.positions[0, 2] - (R - overlap)
        errors.append(abs(place - 0.01 * overlap * math.cos(rate * movement.end_time)))
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


def test_a_slide_converges_at_least_with_the_step() -> None:
    # Sticking turns into sliding somewhere within a step.
    slope = math.radians(30)
    grain = sled()
    overlap = grain.mass * G * math.cos(slope) / (4 * wall_stiffness())
    start = Start((R - overlap) * off(slope), leaning(slope))
    setup = scene(
        grain,
        [start],
        plane(slope, 0.4),
        physics=still(gravity=G, restitution=0.5),
        duration=0.1,
        friction=0.4,
    )
    step = 0.1 / 1000
    finest = end(setup, step / 16).positions
    errors = [np.abs(end(setup, step / n).positions - finest).max() for n in (1, 2, 4)]
    assert errors[1] < 0.75 * errors[0]
    assert errors[2] < 0.75 * errors[1]
    assert errors[2] < 1e-3 * R


def column(share: float) -> tuple[float, float]:
    """Height [m] of the top of a settled column of spheres, and its largest overlap [R]."""
    count = 8
    starts = [Start((0.0, 0.0, (2 * i + 0.999) * R)) for i in range(count)]
    setup = scene(
        spheres_in_line(1),
        starts,
        plane(),
        physics=still(gravity=G, restitution=0.3),
        duration=0.6,
    )
    movement = moved(setup, share)
    return float(movement.positions[-1, 2]), movement.max_overlap


def test_a_settled_column_is_as_high_with_any_step_and_as_its_springs_say() -> None:
    # Sphere i from below carries the weight of all above it; k = E R between two spheres.
    mass = spheres_in_line(1).mass
    loads = mass * G * np.arange(8, 0, -1)
    sunk = loads[0] / wall_stiffness() + loads[1:].sum() / (YOUNG * R)
    tops = [column(share)[0] for share in (0.4, 0.1)]
    assert tops == pytest.approx([15 * R - sunk] * 2, rel=1e-8)


def test_a_margin_outside_of_its_range_is_refused() -> None:
    with pytest.raises(ConfigError, match="margin"):
        NumbaEngine(margin=1.5)
    with pytest.raises(ConfigError, match="fixed_timestep"):
        NumbaEngine(fixed_timestep=0.0)


def test_the_step_of_a_run_is_the_share_asked_for() -> None:
    setup = pressed(still())
    short = replace(setup, duration=1e-3)
    assert moved(short, 0.25).timestep == pytest.approx(0.25 * stable_step(setup), rel=1e-12)
