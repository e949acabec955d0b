import math

import pytest
from pydantic import ValidationError

from fidelity.engine import Physics
from fidelity.grains.settings import GRAVITY, DemSettings
from fidelity.scenes.dosing.settings import PARAMETERS, DosingSettings


def test_defaults_are_the_thirteen_variables() -> None:
    settings = DosingSettings()
    assert tuple(settings.free) == tuple(
        ["l1", "w1", "r1", "s1", "l2", "w2", "r2", "s2", "x1", "y1", "x2", "y2", "v"]
    )
    assert set(settings.all_values()) == set(PARAMETERS)


def test_sections_lie_on_the_straight_line_unless_given() -> None:
    values = DosingSettings(values={"l3": 124.0, "w2": 80.0}).all_values()
    assert values["l1"] == pytest.approx(150 - 26 * 80 / 260)
    assert values["l2"] == pytest.approx(150 - 26 * 180 / 260)
    assert values["w2"] == 80.0


def test_materials_are_those_of_table_1() -> None:
    settings = DosingSettings()
    rice, steel = settings.grain.material(), settings.wall.material()
    assert (rice.young_modulus, rice.poisson_ratio, rice.density) == (1e8, 0.2, 1592.67)
    assert (steel.young_modulus, steel.poisson_ratio) == (2e11, 0.33)
    assert math.degrees(rice.friction_angle) == pytest.approx(43)
    assert math.degrees(steel.friction_angle) == pytest.approx(25)
    assert settings.grain.material(1e6).young_modulus == 1e6


def test_settings_survive_a_round_trip() -> None:
    settings = DosingSettings(free={"l0": (140, 160), "v": (0.5, 2)}, values={"l0": 145})
    assert DosingSettings.model_validate_json(settings.model_dump_json()) == settings


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"free": {"l9": (1, 2)}}, "unknown design parameter 'l9'; did you mean 'l"),
        ({"values": {"vv": 1.0}}, "did you mean 'v'"),
        ({"free": {}}, "at least 1 item"),
        ({"stroke": 400}, "Extra inputs"),
        ({"stroke_mm": "wide"}, "valid number"),
        ({"stroke_mm": math.nan}, "finite"),
        ({"stroke_mm": -1}, "greater than or equal to 0.1"),
        ({"duration_ms": 500}, "lengthen the run"),
        ({"tube_end_z_mm": -200}, "lower it"),
        ({"values": {"z3": 0}}, "z3 = 0 must be at most -1"),
        ({"values": {"z3": -1e-300}}, "must be at most -1"),
        ({"portion_kg": 1.4}, "to 69% with solid grains"),
        ({"grain_width_mm": 8}, "exchange them"),
        ({"free": {"l1": (80, math.inf)}}, "finite"),
    ],
)
def test_wrong_settings_are_named(given: dict[str, object], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        DosingSettings.model_validate(given)


def test_a_level_needs_grains() -> None:
    with pytest.raises(ValidationError, match="grains"):
        DemSettings.model_validate({"spheres_per_grain": 5})


def test_what_a_level_says_of_physics_reaches_the_engine() -> None:
    dem = DemSettings(
        grains=9, contact_law="hertz", restitution=0.6, damping=0.0, damp_gravity=True,
        timestep_factor=1.7,
    )  # fmt: skip
    assert dem.physics() == Physics(
        contact_law="hertz", restitution=0.6, damping=0.0, damp_gravity=True, gravity=GRAVITY,
        timestep_factor=1.7,
    )  # fmt: skip
    assert DemSettings(grains=9).physics(0.4).timestep_factor == 0.4
    assert DemSettings(grains=9).physics().timestep_factor is None
