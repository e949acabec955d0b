"""The silo scene: shares of the weight with known answers."""

import numpy as np
import pytest
from scene_portions import movement_to, portion_of

from fidelity.effects.switch import with_effects
from fidelity.engines.numba import NumbaEngine
from fidelity.grains.portion import largest_overlap, sphere_centres
from fidelity.scenes.silo.run import SiloSettings, silo_load, silo_setup
from geometry.mesh import Mesh
from mesh_checks import merged, open_edges
from mfopt.errors import ConfigError


def test_the_share_is_the_mean_over_the_moments_of_what_pulls_the_walls_down() -> None:
    portion = portion_of(10)
    weight = portion.mass * 9.81
    forces = np.zeros((2, 2, 3))
    forces[:, 0, 2] = np.array([-0.5, -0.7]) * weight
    forces[:, 1, 2] = np.array([-0.5, -0.3]) * weight
    forces[:, :, 0] = 100.0  # sideways: carries nothing
    positions = np.tile([0.0, 0.0, 0.1], (10, 1))
    setup = silo_setup(SiloSettings(width=0.08), portion, seed=2)
    told = silo_load(setup, movement_to(positions, snapshots={"snapshot_wall_forces": forces}))
    assert told.wall_share == pytest.approx(0.6)
    assert told.floor_share == pytest.approx(0.4)
    np.testing.assert_allclose(told.shares, [0.5, 0.7])
    assert told.fill_height == pytest.approx(0.2)


def test_an_engine_without_forces_on_walls_is_told_so() -> None:
    setup = silo_setup(SiloSettings(width=0.08), portion_of(1), seed=1)
    with pytest.raises(ConfigError, match="snapshot_wall_forces"):
        silo_load(setup, movement_to(np.zeros((1, 3))))


def test_the_silo_is_closed_but_at_its_top_and_holds_the_portion() -> None:
    portion = portion_of(60)
    setup = silo_setup(SiloSettings(width=0.08), portion, seed=2)
    sides, floor = setup.walls
    box = merged([Mesh(wall.vertices, wall.triangles) for wall in (sides, floor)])
    rim = box.vertices[open_edges(box)][..., 2]
    assert np.all(rim == rim.max())
    centres = sphere_centres(setup.grain, setup.packing).reshape(-1, 3)
    r = float(portion.grain.radii.max())
    assert np.all(np.abs(centres[:, :2]) <= 0.04 - r)
    assert r <= centres[:, 2].min() < centres[:, 2].max() < rim.max() - r
    assert largest_overlap(setup.grain, setup.packing) == 0.0


def test_forces_are_taken_at_the_end_of_one_run_without_a_break() -> None:
    setup = silo_setup(SiloSettings(width=0.08), portion_of(20), seed=2)
    assert not setup.settle
    assert setup.physics.damp_gravity
    assert setup.snapshot_times[0] > 0.8 * setup.duration
    assert setup.snapshot_times[-1] < setup.duration


@pytest.mark.parametrize("effects", [{}, {"side_wall_friction": {"excess": 0.1}}])
def test_at_rest_sides_and_floor_together_carry_the_weight(
    effects: dict[str, dict[str, float]],
) -> None:
    portion = portion_of(60)
    setup = silo_setup(SiloSettings(width=0.045), portion, seed=1)  # about four times as high
    setup = with_effects(setup, effects)
    movement = NumbaEngine().move(setup, time_limit_s=120.0)
    assert movement.status == "finished", movement.why
    told = silo_load(setup, movement)
    assert told.wall_share + told.floor_share == pytest.approx(1.0, abs=0.01)
    assert 0.15 < told.wall_share < 0.75
