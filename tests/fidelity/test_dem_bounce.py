"""Fall and bounce of the compiled engine against closed forms."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from benchmarks.engine.small_scenes import (
    LEVEL,
    RATIO,
    YOUNG,
    G,
    R,
    Start,
    material,
    moved,
    plane,
    scene,
    spheres_in_line,
    still,
    turned,
    wall_stiffness,
)
from fidelity.dem.restitution import damping_ratio
from fidelity.dem.timestep import stable_timestep
from fidelity.engine import ContactLaw, Grain, Physics, Setup
from mfopt.arrays import Array

LAWS: tuple[ContactLaw, ...] = ("linear", "hertz")
SPEED = 0.3  # [m/s]
# A contact begins somewhere within a step, which shifts what a dashpot loses by a share of the
# step over the time of contact. Grains that start a fraction of a step's way apart show all of it.
PHASES = 16
FINE = 0.03  # share of the stable step


def drops(
    grain: Grain,
    physics: Physics,
    *,
    angle: float = 0.0,
    duration: float = 0.02,
    young: float = YOUNG,
    share: float = FINE,
) -> Setup:
    """Grains side by side, turned about y by `angle`, that fly down to a plane."""
    turn = (math.cos(angle / 2), 0.0, math.sin(angle / 2), 0.0)
    lowest = turned(np.array(turn), grain.offsets)[:, 2].min() - R
    floor = plane(young=young)
    step = share * stable_timestep(grain, floor.material, floor.material, physics)
    starts = [
        Start((0.0, 10 * R * (i - PHASES / 2), 1e-4 + way - lowest), turn, (0.0, 0.0, -SPEED))
        for i, way in enumerate(SPEED * step * np.arange(PHASES) / PHASES)
    ]
    return scene(grain, starts, floor, physics=physics, duration=duration, young=young)


def pairs(physics: Physics) -> Setup:
    """Pairs of spheres that fly at each other along a slanted line."""
    line = np.array([0.6, 0.0, 0.8])
    grain, stuff = spheres_in_line(1), material()
    step = FINE * stable_timestep(grain, stuff, stuff, physics)
    starts = []
    for i, way in enumerate(SPEED * step * np.arange(PHASES) / PHASES):
        gap, middle = 1e-4 + way, np.array([0.0, 10 * R * i, 0.0])
        for sign in (-1.0, 1.0):
            starts.append(
                Start(middle + sign * (R + gap / 2) * line, LEVEL, -sign * SPEED / 2 * line)
            )
    return scene(grain, starts, physics=physics, duration=0.02)


@pytest.mark.parametrize("spheres", [1, 5])
def test_free_fall_is_exact(spheres: int) -> None:
    # Leapfrog integrates a constant force exactly; velocities lag half a step behind.
    start = Start((0.1, 0.2, 0.3), (0.8, 0.0, 0.6, 0.0), (0.4, -0.5, 0.6))
    movement = moved(
        scene(spheres_in_line(spheres), [start], physics=still(gravity=G), duration=0.2)
    )
    t, half = movement.end_time, movement.timestep / 2
    way = np.array(start.velocity) * t - [0.0, 0.0, G * t**2 / 2]
    assert movement.positions[0] == pytest.approx(start.position + way, rel=1e-11)
    speed = np.array(start.velocity) - [0.0, 0.0, G * (t - half)]
    assert movement.velocities[0] == pytest.approx(speed, rel=1e-11)
    assert movement.orientations[0] == pytest.approx(start.orientation, abs=1e-14)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("restitution", [1.0, 0.9, 0.5, 0.1])
@pytest.mark.parametrize("partner", ["wall", "sphere"])
def test_a_sphere_returns_with_the_restitution_asked_for(
    law: ContactLaw, restitution: float, partner: str
) -> None:
    physics = still(contact_law=law, restitution=restitution)
    if partner == "wall":
        movement = moved(drops(spheres_in_line(1), physics), share=FINE)
        returned = movement.velocities[:, 2] / SPEED
    else:
        movement = moved(pairs(physics), share=FINE)
        along = movement.velocities @ [0.6, 0.0, 0.8]
        returned = (along[1::2] - along[::2]) / SPEED
    # omega dt = 0.06: the scatter of the phases is 0.2 of it, their mean of second order.
    assert returned == pytest.approx(np.full(PHASES, restitution), abs=0.012)
    assert returned.mean() == pytest.approx(restitution, abs=1e-3)


@pytest.mark.parametrize("law", LAWS)
def test_numerical_damping_alone_returns_its_own_share(law: ContactLaw) -> None:
    # The force is 1 + d times the spring's on the way in and 1 - d times on the way out.
    damping = 0.2
    movement = moved(drops(spheres_in_line(1), still(contact_law=law, damping=damping)), share=FINE)
    expected = math.sqrt((1 - damping) / (1 + damping))
    assert movement.velocities[:, 2].mean() / SPEED == pytest.approx(expected, rel=2e-3)


def contact_times(setup: Setup, share: float) -> tuple[float, float]:
    """Mean duration of the contact [s], and largest overlap [m], of an elastic bounce."""
    movement = moved(setup, share)
    start = setup.packing.positions[:, 2]
    speed = movement.velocities[:, 2]
    flown = (start - R) / SPEED + (movement.positions[:, 2] - R) / speed
    return float(movement.end_time - flown.mean()), movement.max_overlap * R


def test_a_linear_contact_is_half_an_oscillation() -> None:
    setup = drops(spheres_in_line(1), still())
    duration, overlap = contact_times(setup, FINE)
    rate = math.sqrt(wall_stiffness() / setup.grain.mass)
    assert duration == pytest.approx(math.pi / rate, rel=2e-3)
    assert overlap == pytest.approx(SPEED / rate, rel=1e-3)


def test_a_hertz_contact_lasts_and_yields_as_hertz_says() -> None:
    # m v^2 / 2 = (8/15) E* sqrt(R) d^2.5, and a duration of 2.943 d / v.
    setup = drops(spheres_in_line(1), still(contact_law="hertz"))
    duration, overlap = contact_times(setup, FINE)
    modulus = YOUNG / (2 * (1 - RATIO**2))
    deepest = (15 / 16 * setup.grain.mass * SPEED**2 / (modulus * math.sqrt(R))) ** 0.4
    assert overlap == pytest.approx(deepest, rel=1e-3)
    whole = 2 * math.sqrt(math.pi) * math.gamma(1.4) / math.gamma(0.9)
    assert duration == pytest.approx(whole * deepest / SPEED, rel=2e-3)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("restitution", [1.0, 0.5])
@pytest.mark.parametrize("degrees", [90.0, 60.0, 20.0])
def test_a_clump_hits_with_its_end_as_a_rigid_body(
    law: ContactLaw, restitution: float, degrees: float
) -> None:
    # The velocity of the contact point along the normal is returned e times. A stiff contact is
    # so short that the clump hardly turns in it.
    grain, angle = spheres_in_line(5), math.radians(degrees)
    physics = still(contact_law=law, restitution=restitution)
    setup = drops(grain, physics, angle=angle, duration=3e-3, young=3e9)
    movement = moved(setup, share=FINE)
    arm = 2.5 * R * math.cos(angle)
    inverse = 1 / grain.mass + arm**2 / grain.inertia[1]
    push = (1 + restitution) * SPEED / inverse
    gained = movement.velocities[:, 2] + SPEED
    assert gained.mean() == pytest.approx(push / grain.mass, rel=2e-3)
    turning = np.abs(movement.angular_velocities[:, 1])
    assert turning.mean() == pytest.approx(push * arm / grain.inertia[1], rel=2e-3, abs=1e-9)


def flat_restitution(law: ContactLaw, restitution: float, masses: Array) -> float:
    """Restitution of a body of mass 1 on contacts that feel `masses` each; none of them pulls."""
    power = 1.0 if law == "linear" else 1.5
    zeta = damping_ratio(law, restitution)

    def forces(x: float, v: float) -> Array:
        rate = np.sqrt(power * np.maximum(x, 0.0) ** (power - 1.0) * masses)
        return np.asarray(np.maximum(0.0, np.maximum(x, 0.0) ** power + 2 * zeta * rate * v))

    def free(t: float, y: Array) -> float:
        return float(forces(*y).sum()) if t > 0.1 else 1.0

    free.terminal = True  # type: ignore[attr-defined]
    bounce = solve_ivp(
        lambda t, y: [y[1], -forces(*y).sum()], (0, 20), [0.0, 1.0], events=free, rtol=1e-9
    )
    return float(-bounce.y[1, -1])


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("restitution", [1.0, 0.5])
def test_a_clump_that_lands_flat_is_damped_by_all_its_contacts(
    law: ContactLaw, restitution: float
) -> None:
    # Each dashpot is made for the mass that its own contact feels; together they act on the whole.
    grain = spheres_in_line(5)
    # A dashpot makes up for the lateness of its own damping, not for that of the other contacts:
    # an error of first order in the step.
    setup = drops(grain, still(contact_law=law, restitution=restitution), share=0.01)
    movement = moved(setup, share=0.01)
    masses = 1 / (1 + grain.mass * grain.offsets[:, 0] ** 2 / grain.inertia[1])
    expected = flat_restitution(law, restitution, masses)
    assert movement.velocities[:, 2].mean() / SPEED == pytest.approx(expected, abs=2e-3)
    assert np.abs(movement.angular_velocities).max() < 1e-6
