"""Scenes that the table and the figures of the validation share."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from benchmarks.engine.small_scenes import (
    YOUNG,
    G,
    R,
    Start,
    down,
    leaning,
    moved,
    off,
    plane,
    scene,
    spheres_in_line,
    still,
    wall_stiffness,
)
from fidelity.dem.timestep import stable_timestep
from fidelity.engine import ContactLaw, Grain, Movement, Physics, Setup
from fidelity.engines.numba import MARGIN
from mfopt.arrays import Array

MU = 0.4
PHASES = 16  # places within a step at which a contact begins
SPEED = 0.3  # [m/s] of impact


def dropped(grain: Grain, physics: Physics, *, angle: float = 0.0, young: float = YOUNG) -> Setup:
    """Grains turned about y by `angle` that fly down to a plane, at all phases of a step."""
    turn = (math.cos(angle / 2), 0.0, math.sin(angle / 2), 0.0)
    lowest = -float(np.abs(grain.offsets[:, 0]).max()) * abs(math.sin(angle)) - R
    floor = plane(young=young)
    step = MARGIN * stable_timestep(grain, floor.material, floor.material, physics)
    starts = [
        Start((0.0, 0.05 * (i - PHASES / 2), 1e-4 - lowest + way), turn, (0.0, 0.0, -SPEED))
        for i, way in enumerate(SPEED * step * np.arange(PHASES) / PHASES)
    ]
    duration = 0.02 if young == YOUNG else 3e-3
    return scene(grain, starts, floor, physics=physics, duration=duration, young=young)


def returned(law: ContactLaw, restitution: float, share: float = MARGIN) -> Array:
    """Restitution of a sphere on a plane, at all phases (PHASES,)."""
    setup = dropped(spheres_in_line(1), still(contact_law=law, restitution=restitution))
    return np.asarray(moved(setup, share).velocities[:, 2] / SPEED)


def end_on(law: ContactLaw, restitution: float, degrees: float) -> Array:
    """Restitution of the lowest point of a clump that hits with its end (PHASES,)."""
    grain, angle = spheres_in_line(5), math.radians(degrees)
    physics = still(contact_law=law, restitution=restitution)
    movement = moved(dropped(grain, physics, angle=angle, young=3e9), MARGIN)
    arm = 2.5 * R * math.cos(angle)
    turning = np.abs(movement.angular_velocities[:, 1])
    return np.asarray((movement.velocities[:, 2] + arm * turning) / SPEED)


def on_slope(grain: Grain, slope: float, duration: float, **more: float) -> Movement:
    """A grain on a slope, pressed in by its weight, with the places of 40 moments."""
    contacts = len(grain.radii) if len(grain.radii) == 4 else 1
    overlap = grain.mass * G * math.cos(slope) / (contacts * wall_stiffness())
    speed, friction = more.get("speed", 0.0), more.get("friction", MU)
    start = Start(
        (R - overlap) * off(slope),
        leaning(slope),
        speed * down(slope),
        (0.0, more.get("spin", 0.0), 0.0),
    )
    physics = still(gravity=G, restitution=0.3, rolling_friction=more.get("rolling", 0.0))
    times = np.linspace(0.0, duration, 40)
    setup = scene(
        grain,
        [start],
        plane(slope, friction),
        physics=physics,
        duration=duration,
        friction=friction,
        snapshots=times,
    )
    return moved(setup, MARGIN)


def piles() -> Mapping[str, Physics]:
    """What the clumps of a heap lose energy by."""
    return {
        "friction": still(gravity=G),
        "friction and dashpots": still(gravity=G, restitution=0.5),
        "friction and numerical damping": still(gravity=G, damping=0.2),
    }


def lack(law: ContactLaw, physics: Physics, share: float) -> float:
    """Energy from nowhere, as a share of what was turned over, after clumps fell in a heap."""
    rng = np.random.default_rng(3)
    starts = [
        Start((0.02 * (i % 3), 0.02 * (i // 3 % 3), 0.012 + 0.015 * (i // 9)), q, v)
        for i, (q, v) in enumerate(
            zip(rng.normal(size=(27, 4)), rng.uniform(-0.4, 0.4, (27, 3)), strict=True)
        )
    ]
    grain, floor = spheres_in_line(3), plane(friction=MU)
    setup = scene(
        grain,
        starts,
        floor,
        physics=replace(physics, contact_law=law),
        duration=0.3,
        friction=MU,
    )
    movement = moved(setup, share)
    return movement.energy["gain"] / movement.energy["turnover"]
