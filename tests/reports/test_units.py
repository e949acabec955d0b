"""Numbers as a reader sees them."""

import math

import pytest

from reports.units import Display, design_display, display, number


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        (0.0, "0"), (64.4321, "64.43"), (1279.0, "1279"), (-0.5, "\u22120.5000"),
        (6.0e7, "6.000\u00b710\u2077"), (1.5e-6, "1.500\u00b710\u207b\u2076"),
        (math.nan, "\u2013"), (None, "\u2013"), (math.inf, "failed"), (99.996, "100.0"),
    ],
)  # fmt: skip
def test_numbers_keep_four_significant_digits(value: float | None, shown: str) -> None:
    assert number(value) == shown


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
