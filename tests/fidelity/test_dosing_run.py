import dataclasses

import numpy as np
import pytest
from scene_portions import movement_to

from fidelity.engine import Packing, Setup
from fidelity.grains.portion import loose_portion, sphere_centres
from fidelity.grains.settings import DemSettings
from fidelity.scenes.dosing.design import design, dosing_problem
from fidelity.scenes.dosing.run import COLLAR, cup_filling, dosing_grain, dosing_setup, tally
from fidelity.scenes.dosing.settings import DosingSettings

SETTINGS = DosingSettings()
PROBLEM = dosing_problem(SETTINGS)
MACHINE = design(SETTINGS, PROBLEM.baseline)
DEM = DemSettings(grains=20, spheres_per_grain=3)
ORDER = cup_filling(SETTINGS, DEM, seed=0)


def loose() -> Packing:
    return loose_portion(ORDER.grain, ORDER.cup.section, DEM.grains, 0, chordal_error=1e-3)


def setup() -> Setup:
    return dosing_setup(SETTINGS, MACHINE, ORDER, loose(), snapshots=4)


def test_every_grain_is_counted_where_it_is() -> None:
    nan = np.nan
    where = np.array(
        [
            [0.0, 0.0, -0.561],  # passed
            [0.01, 0.02, -0.560],  # passed, earlier
            [0.2, 0.0, 0.05],  # in the cup at its final place
            [-0.1, 0.0, 0.01],  # on the plate
            [0.0, 0.0, -0.1],  # in the hopper
            [0.3, 0.0, -0.56],  # fell beside the tube
        ]
    )
    times = np.array([0.6, 0.5, nan, nan, nan, 0.7])
    count = tally(MACHINE, setup(), movement_to(where, exit_times=times))
    assert count.passed.tolist() == [0.5, 0.6]
    assert (count.left_in_cup, count.left_on_plate, count.left_in_hopper) == (2, 1, 1)
    assert count.lost == 1
    assert count.first_lost == "x = 300, y = 0, z = -560 mm"


@pytest.mark.parametrize("place", [[0.1, 0.0, -0.2], [0.0, 0.0, 0.4], [1.0, 0.0, 0.01]])
def test_a_grain_outside_of_the_machine_is_lost(place: list[float]) -> None:
    assert tally(MACHINE, setup(), movement_to(np.array([place]))).lost == 1


def test_counts_add_up_wherever_the_grains_are() -> None:
    rng = np.random.default_rng(0)
    where = rng.uniform([-0.4, -0.2, -0.6], [0.4, 0.2, 0.3], (500, 3))
    times = np.where(where[:, 2] < -0.56, 0.5, np.nan)
    count = tally(MACHINE, setup(), movement_to(where, exit_times=times))
    assert len(count.passed) + count.left_in_cup + count.left_in_hopper + count.lost == 500


def test_grains_start_in_the_cup_half_a_stroke_before_the_hole() -> None:
    start = setup()
    packed = loose().positions
    assert start.packing.positions - packed == pytest.approx(np.tile([-0.2, 0, 0], (20, 1)))
    cup = next(wall for wall in start.walls if wall.name == "cup")
    assert [wall.name for wall in start.walls if wall.motion is not None] == ["cup"]
    assert {wall.material for wall in start.walls} == {SETTINGS.wall.material()}
    assert np.ptp(cup.vertices[:, 0]) == pytest.approx(0.13, rel=1e-9)
    assert cup.vertices[:, 2].max() == pytest.approx(COLLAR * MACHINE.cup.height)


def test_cup_ends_a_stroke_further_and_grains_start_with_its_speed() -> None:
    start = setup()
    motion = next(wall.motion for wall in start.walls if wall.name == "cup")
    assert motion is not None
    assert motion.angles is None
    assert motion.displacements[0] == pytest.approx([0.0, 0.0, 0.0])
    assert motion.displacements[-1] == pytest.approx([0.4, 0.0, 0.0])
    assert motion.times[[0, -1]] == pytest.approx([0.0, 0.6])
    assert start.velocities is not None
    speed = 1.5 * 0.4 / 0.6  # v of the dwelling motion, stroke over cycle
    assert start.velocities == pytest.approx(np.tile([speed, 0.0, 0.0], (20, 1)), rel=1e-12)
    first = np.diff(motion.displacements[:3], axis=0)[:, 0] / motion.times[1]
    assert 1.5 * first[0] - 0.5 * first[1] == pytest.approx(speed, rel=1e-3)  # at the start itself


def test_run_ends_at_the_tube_and_snapshots_lie_within_the_cycle() -> None:
    start = setup()
    assert start.exit_z == pytest.approx(-0.56)
    assert start.snapshot_times.shape == (4,)
    assert 0 < start.snapshot_times.min() < start.snapshot_times.max() <= 0.6


def test_portion_weighs_the_same_at_every_level() -> None:
    for grains, spheres in ((60, 1), (300, 3), (1000, 5)):
        grain = dosing_grain(SETTINGS, DemSettings(grains=grains, spheres_per_grain=spheres))
        assert grains * grain.mass == pytest.approx(1.0)


def test_chordal_error_follows_the_grain_unless_given() -> None:
    given = dataclasses.replace(ORDER, chordal_error=5e-4)
    dem = DemSettings(grains=20, spheres_per_grain=3, chordal_error_mm=0.5)
    assert cup_filling(SETTINGS, dem, 0).chordal_error == pytest.approx(given.chordal_error)
    assert ORDER.chordal_error == pytest.approx(0.25 * ORDER.grain.radii[0])


def test_spheres_of_a_turned_grain_lie_where_the_quaternion_puts_them() -> None:
    half = np.sqrt(0.5)
    upright = Packing(np.array([[1.0, 2.0, 3.0]]), np.array([[half, 0.0, -half, 0.0]]))
    centres = sphere_centres(ORDER.grain, upright)[0]  # x turned about -y becomes z
    assert centres == pytest.approx(ORDER.grain.offsets[:, [1, 2, 0]] + [1.0, 2.0, 3.0])
