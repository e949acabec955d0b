"""The record of an effect: what completes it, and where it is absent."""

import pytest

from mfopt.errors import ConfigError
from mfopt.records.effect import Effect, EffectParameter, complete, is_absent

SHAKE = Effect(
    "shake",
    {
        "amplitude": EffectParameter(0.0, 0.0, 1e-3, "m", "of the walls"),
        "frequency": EffectParameter(0.0, 0.0, 50.0, "Hz", "of the sine"),
        "heading": EffectParameter(0.0, -3.0, 3.0, "rad", "of the way", shapes=True),
    },
    "apparatus",
    "x = a sin(2 pi f t)",
    "definition",
)


def test_what_is_not_given_is_at_its_null() -> None:
    assert complete(SHAKE, {"amplitude": 1e-4}) == {
        "amplitude": 1e-4,
        "frequency": 0.0,
        "heading": 0.0,
    }


@pytest.mark.parametrize(
    ("values", "absent"),
    [
        ({}, True),
        ({"amplitude": 1e-4}, True),
        ({"frequency": 20.0, "heading": 1.0}, True),
        ({"amplitude": 1e-4, "frequency": 20.0}, False),
    ],
)
def test_one_null_that_switches_is_enough(values: dict[str, float], absent: bool) -> None:
    assert is_absent(SHAKE, values) is absent


def test_an_unknown_parameter_is_refused_with_the_nearest_name() -> None:
    with pytest.raises(ConfigError, match="no parameter 'amplitud'; the nearest is 'amplitude'"):
        complete(SHAKE, {"amplitud": 1e-4})


def test_a_value_that_is_no_number_is_refused() -> None:
    with pytest.raises(ConfigError, match="frequency = nan"):
        complete(SHAKE, {"frequency": float("nan")})


@pytest.mark.parametrize("values", [{"frequency": 501.0}, {"heading": -1e30}, {"amplitude": 1.0}])
def test_a_value_far_beyond_the_plausible_range_is_refused(values: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match=r"= .* must be at most .*; plausible is"):
        complete(SHAKE, values)


def test_a_value_somewhat_beyond_the_plausible_range_is_accepted() -> None:
    assert complete(SHAKE, {"frequency": 499.0})["frequency"] == 499.0


def test_a_null_outside_its_range_is_refused() -> None:
    with pytest.raises(ConfigError, match="null = 2"):
        EffectParameter(2.0, 0.0, 1.0, "-", "anything")


def test_an_effect_that_nothing_switches_off_is_refused() -> None:
    with pytest.raises(ConfigError, match="'bend'"):
        Effect("bend", {"a": EffectParameter(0, 0, 1, "-", "", shapes=True)}, "material", "", "")
