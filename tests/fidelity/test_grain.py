import numpy as np
import pytest

from fidelity.engine import Grain
from fidelity.grains.grain import grain_volume, line_grain, portion_grain
from mfopt.errors import ConfigError

RICE_DENSITY = 1592.67


def test_one_sphere_has_two_fifths_m_r_squared() -> None:
    grain = line_grain(0.004, 0.004, 1, 1000.0)
    mass = 1000.0 * 4 / 3 * np.pi * 0.002**3
    assert grain.mass == pytest.approx(mass, rel=1e-12)
    assert grain.inertia == pytest.approx(np.full(3, 0.4 * mass * 0.002**2), rel=1e-12)


def test_spheres_that_do_not_touch_add_up_with_the_parallel_axis_theorem() -> None:
    grain = line_grain(0.010, 0.002, 2, 1000.0)  # centres at -4 and 4 mm
    mass = 1000.0 * 4 / 3 * np.pi * 0.001**3
    own = 0.4 * mass * 0.001**2
    across = 2 * (own + mass * 0.004**2)
    assert grain.mass == pytest.approx(2 * mass, rel=1e-12)
    assert grain.inertia == pytest.approx([2 * own, across, across], rel=1e-12)


def test_overlaps_count_once_as_lenses() -> None:
    # Two unit spheres at distance d share a lens of pi (4 + d) (2 - d)^2 / 12.
    r, d = 1.0, 1.25
    lens = np.pi * (4 * r + d) * (2 * r - d) ** 2 / 12
    expected = 5 * 4 / 3 * np.pi - 4 * lens
    assert grain_volume(7.0, 2.0, 5) == pytest.approx(expected, rel=1e-12)


def test_union_agrees_with_monte_carlo() -> None:
    grain = line_grain(7.0, 2.0, 5, 1.0)
    rng = np.random.default_rng(1)
    points = rng.uniform(-1, 1, (400_000, 3)) * [3.5, 1.0, 1.0]
    gaps = np.linalg.norm(points[:, None] - grain.offsets, axis=2)
    inside = points[(gaps < 1.0).any(axis=1)]
    box = 7.0 * 2.0 * 2.0
    share = len(inside) / len(points)
    squares = (inside**2).mean(axis=0) * share * box
    assert share * box == pytest.approx(grain.mass, rel=5e-3)
    assert squares[1] + squares[2] == pytest.approx(grain.inertia[0], rel=1e-2)
    assert squares[0] + squares[1] == pytest.approx(grain.inertia[1], rel=1e-2)


def test_many_spheres_become_a_capsule() -> None:
    length, r = 7.0, 1.0
    straight = length - 2 * r
    cylinder, ball = np.pi * r**2 * straight, 4 / 3 * np.pi * r**3
    grain = line_grain(length, 2 * r, 2001, 1.0)
    axial = cylinder * r**2 / 2 + 0.4 * ball * r**2
    # Half balls about the capsule's middle: 2/5 r^2 + h^2/4 + 3 h r / 8.
    across = cylinder * (straight**2 / 12 + r**2 / 4) + ball * (
        0.4 * r**2 + straight**2 / 4 + 3 * straight * r / 8
    )
    assert grain.mass == pytest.approx(cylinder + ball, rel=1e-5)
    assert grain.inertia == pytest.approx([axial, across, across], rel=1e-5)


@pytest.mark.parametrize("spheres", [1, 3, 5])
@pytest.mark.parametrize("grains", [60, 1000, 18380])
def test_scale_keeps_the_mass_of_the_portion_and_the_shape(grains: int, spheres: int) -> None:
    grain = portion_of(grains, spheres)
    assert grains * grain.mass == pytest.approx(1.0, rel=1e-12)
    if spheres > 1:
        length = np.ptp(grain.offsets[:, 0]) + 2 * grain.radii[0]
        assert length / (2 * grain.radii[0]) == pytest.approx(3.5, rel=1e-12)


def test_full_level_is_scaled_by_1_24() -> None:
    assert portion_of(18380, 5).radii[0] == pytest.approx(1.2415e-3, rel=1e-4)


def test_inertia_grows_with_the_fifth_power_of_the_length() -> None:
    small, large = portion_of(8000, 5), portion_of(1000, 5)  # twice the length
    assert large.inertia / small.inertia == pytest.approx(np.full(3, 2.0**5), rel=1e-12)


def test_grain_wider_than_long_is_refused() -> None:
    with pytest.raises(ConfigError, match="must be at least its width"):
        line_grain(1e-3, 2e-3, 5, 1000.0)


def portion_of(grains: int, spheres: int) -> Grain:
    return portion_grain(
        mass=1.0, density=RICE_DENSITY, length=7e-3, width=2e-3, grains=grains, spheres=spheres
    )
