"""Damping ratios for a coefficient of restitution, against the bounce integrated numerically."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fidelity.dem.restitution import damping_ratio, hertz_restitution, linear_restitution
from fidelity.engine import ContactLaw
from mfopt.arrays import Array
from mfopt.errors import ConfigError

LAWS: tuple[ContactLaw, ...] = ("linear", "hertz")


def bounced(power: float, zeta: float, *, mass: float, stiffness: float, speed: float) -> float:
    """Restitution of m x'' = -k x^p - c x', c = 2 zeta sqrt(dF/dx m), until the force is zero."""

    def force(x: float, v: float) -> float:
        x = max(x, 0.0)
        rate = 2 * zeta * math.sqrt(power * stiffness * x ** (power - 1) * mass)
        return float(-stiffness * x**power - rate * v)

    def gone(t: float, y: Array) -> float:
        return float(force(*y)) if y[1] < 0.0 else -1.0

    gone.terminal = True  # type: ignore[attr-defined]
    scale = (mass * speed**2 / stiffness) ** (1 / (power + 1))
    done = solve_ivp(
        lambda t, y: [y[1], force(*y) / mass],
        (0.0, 1e3 * scale / speed),
        [1e-12 * scale, speed],
        events=gone,
        rtol=1e-10,
        atol=1e-14 * scale,
        max_step=0.01 * scale / speed,
    )
    return float(-done.y[1, -1] / speed)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("restitution", [0.95, 0.7, 0.4, 0.15])
def test_the_damping_ratio_returns_what_was_asked_for(law: ContactLaw, restitution: float) -> None:
    zeta = damping_ratio(law, restitution)
    power = 1.0 if law == "linear" else 1.5
    # Neither mass, stiffness nor speed matters.
    for mass, stiffness, speed in ((1.0, 1.0, 1.0), (1e-4, 5e5, 0.3)):
        assert bounced(power, zeta, mass=mass, stiffness=stiffness, speed=speed) == pytest.approx(
            restitution, abs=1e-5
        )


@pytest.mark.parametrize("zeta", [0.0, 3e-4, 0.0488, 0.2330348, 1.0, 20.0])
def test_compiled_code_returns_the_same_bits(zeta: float) -> None:
    # A run repeats bit for bit only if the damping ratio does.
    assert hertz_restitution(zeta) == hertz_restitution.py_func(zeta)


@pytest.mark.parametrize("of", [linear_restitution, hertz_restitution])
def test_restitution_falls_from_one_as_damping_grows(of: object) -> None:
    assert callable(of)
    values = [of(zeta) for zeta in (0.0, 0.05, 0.2, 0.5, 0.99, 1.0, 1.01, 2.0)]
    assert values[0] == pytest.approx(1.0, abs=1e-9)
    assert (np.diff(values) < 0.0).all()
    assert values[5] == pytest.approx((values[4] + values[6]) / 2, rel=1e-3)


def test_critical_damping_of_a_linear_spring_returns_e_to_minus_two() -> None:
    assert linear_restitution(1.0) == pytest.approx(math.exp(-2), rel=1e-12)


@pytest.mark.parametrize("law", LAWS)
def test_no_damping_for_a_restitution_of_one(law: ContactLaw) -> None:
    assert damping_ratio(law, 1.0) == 0.0


@pytest.mark.parametrize("restitution", [0.0, -0.5, 1.1, float("nan")])
def test_a_restitution_that_no_dashpot_has_is_refused(restitution: float) -> None:
    with pytest.raises(ConfigError, match="restitution"):
        damping_ratio("linear", restitution)
