"""How units may be written, and what they mean."""

import pytest

from calibration.recordings.units import UNITS, unit_of, units_like


@pytest.mark.parametrize("name", UNITS)
def test_capitals_do_not_matter(name: str) -> None:
    for written in (name, name.upper(), f" {name} "):
        its = unit_of(written)
        assert its is not None
        assert (its.factor, its.si) == UNITS[name]


@pytest.mark.parametrize("written", ["mPa", "Mm", "Mg", "Ms", "Mm/s"])
def test_another_prefix_is_no_spelling(written: str) -> None:
    # A millipascal is no megapascal, a megagram no milligram.
    assert unit_of(written) is None


def test_units_are_named_as_they_should_be_written() -> None:
    assert units_like("Pa") == ["Pa", "kPa", "MPa"]
