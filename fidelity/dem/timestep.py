"""The time step, from the stiffness of a contact and the mass that it moves.

A mass m on a spring k is integrated stably up to dt = 2 sqrt(m / k). The hardest single contact of
a grain acts on its outermost sphere, where it turns the grain, too:

    1 / m_contact = 1 / m + max over n of (b x n) . I^-1 (b x n),   b the sphere's centre;

between two grains both give way, on a wall the stiffness is twice that between grains, so that both
come to the same. A dashpot of damping ratio zeta, as `law.viscosity` makes it, shortens the stable
step to 2 sqrt(m / k) / sqrt(1 + 2 zeta). Sliding friction acts at the surface with the tangential
stiffness, a rolling spring on the turning alone. In a pile many contacts act at once: the margin of
`NumbaEngine` covers that.
"""

import math

import numpy as np

from fidelity.dem.law import law_of, pair_of
from fidelity.engine import Grain, Material, Physics

# Hertz contacts stiffen as they are pressed; the step holds for overlaps of this part of a radius.
HERTZ_OVERLAP = 0.1


def stable_timestep(
    grain: Grain, grain_material: Material, wall_material: Material, physics: Physics
) -> float:
    """Largest stable step [s] of the hardest single contact of a grain."""
    rates = [
        _rate(grain, grain_material, grain_material, physics, wall=False),
        _rate(grain, grain_material, wall_material, physics, wall=True),
    ]
    return 2.0 / math.sqrt(max(rates) * (1.0 + 2.0 * law_of(physics).zeta))


def _rate(grain: Grain, a: Material, b: Material, physics: Physics, *, wall: bool) -> float:
    """Largest stiffness over mass [1/s2]."""
    pair = pair_of(a, b, physics, wall=wall)
    largest = 0.0
    for centre, r in zip(grain.offsets, grain.radii, strict=True):
        radius = r if wall else r / 2
        if physics.contact_law == "hertz":
            contact = math.sqrt(radius * HERTZ_OVERLAP * r)
            normal, tangential = 2 * pair.normal * contact, 8 * pair.tangential * contact
        else:
            normal, tangential = pair.normal * radius, pair.tangential * radius
        both = 1.0 if wall else 2.0
        push = 1 / grain.mass + _turning(centre, grain.inertia)
        slide = 1 / grain.mass + _turning(centre, grain.inertia) + r * r / grain.inertia.min()
        largest = max(largest, both * normal * push, both * tangential * slide)
        if physics.rolling_friction > 0.0:
            roll = physics.rolling_stiffness * tangential * radius * radius
            largest = max(largest, both * roll / grain.inertia.min())
    return largest


def _turning(b: np.ndarray, inertia: np.ndarray) -> float:
    """Largest (b x n) . I^-1 (b x n) over unit vectors n [1/kg]."""
    cross = np.array([[0, -b[2], b[1]], [b[2], 0, -b[0]], [-b[1], b[0], 0]])
    return float(np.linalg.eigvalsh(cross.T @ np.diag(1 / inertia) @ cross)[-1])
