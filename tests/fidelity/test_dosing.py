import pickle

import numpy as np
import pytest

from fidelity.scenes.dosing.design import (
    cup_motion,
    design,
    design_parts,
    dosing_problem,
    plate,
    starting_designs,
)
from fidelity.scenes.dosing.settings import CupSettings, DosingSettings
from mesh_checks import merged, open_edges
from mfopt.arrays import Array
from mfopt.errors import ConfigError, InvalidDesign

SETTINGS = DosingSettings()
PROBLEM = dosing_problem(SETTINGS)


def with_values(**values: float) -> Array:
    return np.array([{**PROBLEM.named(PROBLEM.baseline), **values}[n] for n in PROBLEM.names])


def test_baseline_is_a_straight_hopper_and_a_dwelling_cup() -> None:
    machine = design(SETTINGS, PROBLEM.baseline)
    z = np.linspace(0.0, -0.26, 14)
    share = z[:, None] / -0.26
    expected = (1 - share) * [0.150, 0.115, 0.025, 0.0] + share * [0.095, 0.070, 0.025, 0.0]
    assert machine.loft.values(z) == pytest.approx(expected, abs=1e-12)
    motion = cup_motion(SETTINGS, PROBLEM.baseline)
    over_hole = (motion.times >= 0.25 * 0.6) & (motion.times <= 0.75 * 0.6)
    assert motion.positions[over_hole] == pytest.approx(np.zeros(over_hole.sum()), abs=1e-12)
    assert motion.velocities[[0, -1]] == pytest.approx(1.5 * 0.4 / 0.6, rel=1e-9)


def test_units_and_bounds_are_those_of_the_user() -> None:
    assert {v.name: v.unit for v in PROBLEM.variables}["l1"] == "mm"
    assert {v.name: (v.lower, v.upper) for v in PROBLEM.variables}["v"] == (0.2, 4)


def test_cup_goes_from_half_a_stroke_before_to_half_a_stroke_behind() -> None:
    motion = cup_motion(SETTINGS, with_values(y1=0.6, y2=0.3, v=2.0))
    assert motion.positions[[0, -1]] == pytest.approx([-0.2, 0.2], abs=1e-12)
    assert motion.velocities[[0, -1]] == pytest.approx(np.full(2, 2.0 * 0.4 / 0.6), rel=1e-9)
    travelled = np.concatenate([[0.0], np.cumsum(np.diff(motion.times) * (
        motion.velocities[1:] + motion.velocities[:-1]) / 2)])  # fmt: skip
    assert motion.positions[0] + travelled == pytest.approx(motion.positions, abs=1e-4)


def test_plate_carries_the_cup_over_its_whole_travel() -> None:
    x = with_values(x1=0.45, y1=0.1, x2=0.55, y2=0.9)  # overshoots the end
    machine = design(SETTINGS, x)
    farthest = np.abs(machine.cup_position(np.linspace(0, 0.6, 2001))).max()
    reach = np.abs(plate(machine, 1e-3).vertices).max(axis=0)
    assert farthest > 0.2
    assert reach[0] > farthest + 0.065
    assert reach[1] > 0.05


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"w1": 60.0, "r1": 45.0}, "radius"),
        ({"l2": 150.0, "w2": 50.0, "r2": 40.0}, "radius"),
    ],
)
def test_a_design_that_cannot_be_built_is_named(values: dict[str, float], message: str) -> None:
    x = with_values(**values)
    why = PROBLEM.impossible(x)
    assert why is not None
    assert message in why
    with pytest.raises(InvalidDesign, match=message):
        design(SETTINGS, x)


def test_motion_with_its_points_exchanged_is_refused() -> None:
    settings = DosingSettings(free={"x1": (0.05, 0.9), "x2": (0.1, 0.95)})
    why = dosing_problem(settings).impossible(np.array([0.8, 0.3]))
    assert why is not None
    assert "x1" in why


def test_values_of_hole_and_tube_can_be_freed() -> None:
    settings = DosingSettings(free={"l0": (140, 170), "s3": (-10, 10), "z1": (-100, -50)})
    problem = dosing_problem(settings)
    assert dict(problem.named(problem.baseline)) == {"l0": 150, "s3": 0, "z1": -80}
    machine = design(settings, np.array([160.0, 5.0, -60.0]))
    assert machine.hole.length == pytest.approx(0.160)
    assert machine.loft.sections[3].shift == pytest.approx(0.005)
    assert machine.loft.heights[1] == pytest.approx(-0.060)


def test_crossed_sections_and_short_tube_are_invalid_designs() -> None:
    settings = DosingSettings(free={"z1": (-200, -50), "z3": (-540, -200)})
    problem = dosing_problem(settings)
    assert "crossed" in (problem.impossible(np.array([-190.0, -260.0])) or "")


def test_a_baseline_that_cannot_be_built_is_wrong_input() -> None:
    with pytest.raises(ConfigError, match="is impossible: section 1"):
        dosing_problem(DosingSettings(values={"r1": 45.0, "w1": 60.0}))
    with pytest.raises(ConfigError, match="outside its bounds"):
        dosing_problem(DosingSettings(values={"v": 9.0}))
    with pytest.raises(ConfigError, match="cup"):
        dosing_problem(DosingSettings(cup=CupSettings(radius_mm=60)))


def test_parts_for_viewing_fit_together() -> None:
    parts = design_parts(SETTINGS, PROBLEM.baseline)
    assert list(parts) == ["cup", "plate", "hopper", "tube"]
    assert parts["cup"].vertices[:, 0].mean() == pytest.approx(-0.2, abs=1e-9)
    whole = merged([parts["plate"], parts["hopper"], parts["tube"]])
    rims = whole.vertices[np.unique(open_edges(whole))]
    at_end = np.isclose(rims[:, 2], -0.56)
    on_plate_edge = np.isclose(rims[:, 2], 0.0) & (np.abs(rims[:, 0]) > 0.2)
    assert (at_end | on_plate_edge).all()  # no open seam between hole, hopper and tube


def test_problem_can_be_sent_to_another_process() -> None:
    again = pickle.loads(pickle.dumps(PROBLEM))
    assert again.impossible(PROBLEM.baseline) is None


def test_the_hole_follows_from_the_cup_unless_it_is_given() -> None:
    assert SETTINGS.all_values()["l0"] == 150
    small = CupSettings(length_mm=90, width_mm=70, radius_mm=15, volume_ml=600)
    values = DosingSettings(cup=small, portion_kg=0.4).all_values()
    assert [values[name] for name in ("l0", "w0", "r0")] == [110, 85, 20]
    assert values["l1"] == pytest.approx(110 + 80 / 260 * (95 - 110))
    given = DosingSettings(cup=small, portion_kg=0.4, values={"l0": 120}).all_values()
    assert [given[name] for name in ("l0", "w0")] == [120, 85]


def test_starts_are_the_simple_motions_over_the_hopper_of_the_baseline() -> None:
    starts = starting_designs(PROBLEM)
    assert list(starts) == [
        "baseline", "constant", "dwell long", "dwell fast", "slow", "slow early", "creep",
    ]  # fmt: skip
    hopper = [i for i, name in enumerate(PROBLEM.names) if name[0] in "lwrs"]
    for x in starts.values():
        assert (x[hopper] == PROBLEM.baseline[hopper]).all()
        assert PROBLEM.impossible(x) is None
    creep = dict(zip(PROBLEM.names, starts["creep"], strict=True))
    assert [creep[name] for name in ("x1", "y1", "x2", "y2", "v")] == [0.3, 0.4, 0.7, 0.5, 1.2]


def test_a_motion_out_of_bounds_is_no_start_and_fixed_values_stay() -> None:
    narrow = dosing_problem(DosingSettings(free={"x1": (0.2, 0.3), "v": (1.0, 2.0)}))
    starts = starting_designs(narrow)
    assert list(starts) == ["baseline", "constant", "dwell long", "slow", "creep"]
    assert starts["dwell long"] == pytest.approx([0.2, 1.5])
    hopper_only = dosing_problem(DosingSettings(free={"l1": (80, 180)}))
    assert list(starting_designs(hopper_only)) == ["baseline"]


def test_the_objectives_of_dosing_are_times() -> None:
    assert dosing_problem(DosingSettings()).objective_unit == "s"
