"""The loft is the cubic through its sections, and an impossible one has a name."""

import numpy as np
import pytest
from hopper_designs import CURVED, HEIGHTS, HOLE, TOUCHING, TUBE, prism, straight

from geometry.loft import Loft, check_loft, extremal_depths
from geometry.sections import Section
from mfopt.errors import ConfigError, InvalidDesign


def test_loft_passes_through_its_sections() -> None:
    found = CURVED.values(np.array(HEIGHTS))
    wanted = [(s.length, s.width, s.radius, s.shift) for s in CURVED.sections]
    assert found == pytest.approx(np.array(wanted), abs=1e-15)
    assert CURVED.section(0.0) == HOLE  # exactly: plate and hopper share this edge


def test_loft_reproduces_any_cubic() -> None:
    z = np.array(HEIGHTS)

    def cubic(t):
        return 0.1 + 0.2 * t - 0.9 * t**2 + 3 * t**3

    loft = Loft(HEIGHTS, tuple(Section(cubic(t), 0.1, 0.02, 2 * t) for t in z))
    between = np.linspace(0.0, -0.26, 23)
    length, width, _, shift = loft.values(between).T
    assert length == pytest.approx(cubic(between), abs=1e-14)
    assert np.all(width == 0.1)
    assert shift == pytest.approx(2 * between, abs=1e-14)
    slope = loft.values(between, derivative=1)[:, 0]
    assert slope == pytest.approx(0.2 - 1.8 * between + 9 * between**2, abs=1e-12)
    bend = loft.values(between, derivative=2)[:, 0]
    assert bend == pytest.approx(-1.8 + 18 * between, abs=1e-10)


def test_sections_on_a_line_give_a_straight_loft() -> None:
    assert np.abs(straight().values(np.linspace(0, -0.26, 9), derivative=2)).max() < 1e-12


def test_equal_sections_give_exactly_the_same_section_everywhere() -> None:
    assert all(prism(TUBE).section(z) == TUBE for z in np.linspace(0.0, -0.26, 17))


@pytest.mark.parametrize("cubic", [-1e-15, 0.0, 1e-15, 3.0])
def test_stationary_points_are_found_even_of_almost_parabolas(cubic: float) -> None:
    # 1 - 0.2 z + z^2 + cubic z^3 is lowest near z = 0.1 if the cubic part is small.
    depths = extremal_depths(np.array([1.0, -0.2, 1.0, cubic]), 0.5)
    values = 1 - 0.2 * depths + depths**2 + cubic * depths**3
    z = np.linspace(0, 0.5, 50_001)
    assert values.min() == pytest.approx((1 - 0.2 * z + z**2 + cubic * z**3).min(), abs=1e-9)


def test_crossed_sections_are_named() -> None:
    with pytest.raises(InvalidDesign, match=r"crossed sections: section 1 at z = -80 mm .* -70 mm"):
        check_loft(Loft((0.0, -0.08, -0.07, -0.26), CURVED.sections))
    with pytest.raises(InvalidDesign, match="crossed sections"):
        check_loft(Loft((0.0, -0.08, -0.08, -0.26), CURVED.sections))


def test_radius_too_large_for_its_section_is_named() -> None:
    with pytest.raises(InvalidDesign, match=r"section 1: radius = 45 mm .* 30 mm"):
        check_loft(Loft(HEIGHTS, (HOLE, Section(0.08, 0.06, 0.045, 0.0), TUBE, TUBE)))


@pytest.mark.parametrize(
    ("middle", "quantity"),
    [
        # Width 115, 12, 12, 70 mm: the cubic dips below nothing between the narrow sections.
        (Section(0.08, 0.012, 0.005, 0.0), "width"),
        # Radius 25, 1.5, 1.5, 25 mm.
        (Section(0.08, 0.08, 0.0015, 0.0), "radius"),
        # Radius exactly half the width at sections 1 and 2 but more in between.
        (Section(0.12, 0.06, 0.03, 0.0), "flat part of the width"),
    ],
)
def test_pinch_between_the_sections_is_named(middle: Section, quantity: str) -> None:
    loft = Loft(HEIGHTS, (HOLE, middle, middle, TUBE))
    with pytest.raises(InvalidDesign, match=f"pinched loft: {quantity}") as raised:
        check_loft(loft)
    assert "between the sections" in str(raised.value)


def test_loft_may_touch_its_limit() -> None:
    check_loft(TOUCHING)
    check_loft(prism(Section(0.08, 0.08, 0.04, 0.0)))


def test_four_sections_are_needed() -> None:
    with pytest.raises(ConfigError, match="3 sections"):
        Loft(HEIGHTS, (HOLE, TUBE, TUBE))
