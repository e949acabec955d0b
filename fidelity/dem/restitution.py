"""From the coefficient of restitution to the damping ratio of a contact, exactly.

The contact force is elastic plus viscous and never pulls, so that a contact ends when the sum
reaches zero, before the overlap does. With the mass m on the contact, the viscous force is

    F = 2 zeta sqrt(S m) v,   S = dF_elastic / d(overlap),

for which the restitution depends on zeta alone, not on speed, mass or stiffness.

Sources: Schwager & Poeschel 2007, doi:10.1007/s10035-007-0065-z (linear, with the end of contact
as here); Tsuji, Tanaka & Ishida 1992, doi:10.1016/0032-5910(92)88030-L (Hertz).
"""

import math
from collections.abc import Callable
from functools import cache

from fidelity.dem.compiled import compiled_exactly
from fidelity.engine import ContactLaw
from mfopt.errors import ConfigError

LEAST = 0.01  # a damping that returns less is beyond what a spring and dashpot can do well


@cache
def damping_ratio(law: ContactLaw, restitution: float) -> float:
    """Damping ratio zeta [-] whose bounce returns `restitution` times the speed.

    Raises:
        ConfigError: if the restitution is not in 0.01 to 1.
    """
    if not LEAST <= restitution <= 1.0:
        raise ConfigError(
            f"restitution = {restitution:g} must lie in {LEAST:g} to 1; "
            "1 loses nothing, 0.3 to 0.7 is usual"
        )
    if restitution == 1.0:
        return 0.0
    from scipy.optimize import brentq

    of: Callable[[float], float] = linear_restitution if law == "linear" else hertz_restitution
    return float(brentq(lambda zeta: of(zeta) - restitution, 0.0, 20.0, xtol=1e-12))


def linear_restitution(zeta: float) -> float:
    """Restitution of a linear spring and dashpot that do not pull.

    Source: Schwager & Poeschel 2007, eq. 21.
    """
    if zeta < 1.0:
        omega = math.sqrt(1.0 - zeta * zeta)
        # The angle in (0, pi) at which the force, growing from 2 zeta, is back at zero.
        return math.exp(-zeta / omega * math.atan2(2.0 * zeta * omega, 2.0 * zeta**2 - 1.0))
    if zeta == 1.0:
        return math.exp(-2.0)
    rate = math.sqrt(zeta * zeta - 1.0)
    return math.exp(-zeta / rate * math.log((zeta + rate) / (zeta - rate)))


@compiled_exactly
def hertz_restitution(zeta: float) -> float:
    """Restitution of a Hertz contact with the damping of Tsuji et al., not pulling.

    In units in which mass, speed of impact and the Hertz stiffness are 1 the bounce obeys
    x'' = -x^1.5 - 2 zeta sqrt(1.5) x^0.25 x'; with the energy as variable it is integrated by
    the classical Runge-Kutta method until the force vanishes.
    """
    c = 2.0 * zeta * math.sqrt(1.5)

    def force(x: float, v: float) -> float:
        return -x * math.sqrt(x) - c * math.sqrt(math.sqrt(x)) * v

    # Start where the elastic force is negligible: x = v t.
    x, v, h = 1e-9, 1.0, 1.0 / 2000.0
    while True:
        k1x, k1v = v, force(x, v)
        k2x, k2v = v + 0.5 * h * k1v, force(max(x + 0.5 * h * k1x, 0.0), v + 0.5 * h * k1v)
        k3x, k3v = v + 0.5 * h * k2v, force(max(x + 0.5 * h * k2x, 0.0), v + 0.5 * h * k2v)
        k4x, k4v = v + h * k3v, force(max(x + h * k3x, 0.0), v + h * k3v)
        new_x = x + h * (k1x + 2 * k2x + 2 * k3x + k4x) / 6.0
        new_v = v + h * (k1v + 2 * k2v + 2 * k3v + k4v) / 6.0
        if new_x <= 0.0 or (new_v < 0.0 and force(new_x, new_v) >= 0.0):
            return float(-new_v)
        x, v = new_x, new_v
