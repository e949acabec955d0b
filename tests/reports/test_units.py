"""Numbers as a reader sees them."""

import math

import pytest

from reports.tables import change_text
from reports.units import Display, design_display, display, number


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (0.0, "0"), (64.4321, "64.43"), (1279.0, "1279"), (-0.5, "\u22120.5000"),
        (6.0e7, "6.000\u00b710\u2077"), (1.5e-6, "1.500\u00b710\u207b\u2076"),
        (math.nan, "\u2013"), (None, "\u2013"), (99.996, "100.0"),
    ],
)  # fmt: skip
def test_numbers_keep_four_significant_digits(value: float | None, shown: str) -> None:
    assert number(value) == shown


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (5e-324, "5\u00b710\u207b\u00b3\u00b2\u2074"),
        (-1.7976931348623157e308, "\u22122\u00b710\u00b3\u2070\u2078"),
        (math.inf, "over 10\u00b3\u2070\u2078"), (-math.inf, "\u2212over 10\u00b3\u2070\u2078"),
    ],
)  # fmt: skip
def test_the_smallest_and_largest_numbers_are_shown(value: float, shown: str) -> None:
    assert number(value, 1) == shown


def test_what_overflows_in_its_unit_is_no_failure() -> None:
    assert Display(1e3, "ms").text(1e308) == number(math.inf)
    assert Display(1e3, "ms").text(math.inf) == "failed"


@pytest.mark.parametrize("bounds", [(-1e308, 1e308), (0.0, 5e-324), (1e300, 2e300), (0.0, 1e9)])
def test_design_values_of_any_size_are_short(bounds: tuple[float, float]) -> None:
    shown = design_display("m", *bounds)
    assert all(len(shown.text(bound)) <= 12 for bound in bounds)


def test_no_value_is_shown_as_negative_zero() -> None:
    assert Display(1.0, "mm", 1).text(-0.01) == "0.0"


def test_seconds_below_ten_read_as_milliseconds_and_above_as_seconds() -> None:
    assert display("s", [0.05, 0.1]).full(0.0644) == "64.40\u202fms"
    assert display("s", [20.0, 30.0]).full(25.0) == "25.00\u202fs"
    assert display("s", [0.05, math.inf]).unit == "ms"  # failed runs do not decide


def test_design_values_resolve_a_thousandth_of_their_range() -> None:
    for lower, upper, unit in ((0.08, 0.18, "m"), (0.05, 0.45, "-"), (-0.04, 0.04, "m")):
        shown = design_display(unit, lower, upper)
        step = (upper - lower) / 1000.0
        a, b = shown.text(lower + step / 2), shown.text(lower + 2.6 * step)
        assert a != b
        assert len(a) <= 6


@pytest.mark.parametrize(
    ("reduction", "text"),
    [(-192.0, "+192\u202f%"), (40.0, "\u221240.0\u202f%"), (0.0, "0\u202f%")],
)
def test_less_than_before_is_a_negative_change(reduction: float, text: str) -> None:
    assert change_text(reduction) == text
