"""What every run of every grain engine must do: account for all grains, end in time, repeat."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from engine_scenes import (
    GRAIN_MATERIAL,
    LIMIT_S,
    WALL_MATERIAL,
    G,
    R,
    assert_all_accounted,
    box,
    lattice,
    level,
    line_of,
    on_every_engine,
    pile_in_box,
    setup_of,
)

from fidelity.engine import Engine, Movement, Packing, Setup


@on_every_engine
def test_the_time_step_is_the_one_announced(engine: Engine) -> None:
    setup = setup_of(line_of(3), Packing(np.zeros((1, 3)), level(1)), duration=0.02)
    movement = engine.move(setup, time_limit_s=LIMIT_S)
    told = engine.timestep(setup.grain, GRAIN_MATERIAL, WALL_MATERIAL, setup.physics)
    assert movement.timestep == pytest.approx(told, rel=1e-9)


@on_every_engine
def test_grains_settle_in_a_box_and_none_is_lost(engine: Engine) -> None:
    setup = replace(pile_in_box(2.0), settle=True)
    movement = engine.move(setup, time_limit_s=LIMIT_S)
    assert movement.status == "finished", movement.why
    assert_all_accounted(setup, movement)
    assert movement.end_time < setup.duration
    assert np.isnan(movement.exit_times).all()
    x, y, z = np.abs(movement.positions).T
    assert x.max() < 8 * R
    assert y.max() < 6 * R
    assert z.min() > 0.5 * R
    assert z.max() < setup.packing.positions[:, 2].max()
    # At rest: less energy than lifts each grain by a tenth of its radius.
    energy = 0.5 * setup.grain.mass * np.sum(movement.velocities**2)
    assert energy < 0.1 * setup.grain.mass * G * R * 40


@cache
def falling_pile(engine: Engine) -> tuple[Setup, Movement]:
    """40 grains fallen into a box, not yet at rest."""
    setup = replace(pile_in_box(0.15), snapshot_times=np.array([0.05, 0.1]))
    return setup, engine.move(setup, time_limit_s=LIMIT_S)


@on_every_engine
def test_energy_comes_from_nowhere_but_height(engine: Engine) -> None:
    setup, movement = falling_pile(engine)
    assert movement.status == "finished", movement.why
    weight = setup.grain.mass * G
    drop = float(np.sum(setup.packing.positions[:, 2] - movement.positions[:, 2]))
    left = 0.5 * setup.grain.mass * float(np.sum(movement.velocities**2))
    assert drop > 0
    assert left < weight * drop
    # No more than if all had fallen to the floor at once.
    assert 0 < movement.max_kinetic_energy < weight * float(setup.packing.positions[:, 2].sum())
    assert movement.max_overlap < 0.5


@on_every_engine
def test_the_same_setup_repeats_bit_for_bit(engine: Engine) -> None:
    setup, one = falling_pile(engine)
    two = engine.move(setup, time_limit_s=LIMIT_S)
    assert one.snapshots["snapshot_positions"].shape == (2, 40, 3)
    for name in ("exit_times", "positions", "orientations", "velocities", "angular_velocities"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
    for name, values in one.snapshots.items():
        np.testing.assert_array_equal(values, two.snapshots[name])
    for name in ("steps", "sphere_steps", "max_overlap", "max_kinetic_energy"):
        assert getattr(one, name) == getattr(two, name)


@on_every_engine
def test_grains_that_cannot_pass_any_more_end_the_run(engine: Engine) -> None:
    setup = replace(pile_in_box(1.0), idle_after=0.05, idle_above_z=0.0)
    movement = engine.move(setup, time_limit_s=LIMIT_S)
    assert movement.status == "finished", movement.why
    assert movement.end_time == pytest.approx(0.05, abs=0.005)


@on_every_engine
def test_the_time_limit_ends_a_run(engine: Engine) -> None:
    movement = engine.move(pile_in_box(3600.0), time_limit_s=2.0)
    assert movement.status == "timed_out"
    assert movement.why is not None
    assert "2 s" in movement.why
    assert movement.positions.shape == (40, 3)


@on_every_engine
def test_overlapping_grains_that_burst_are_crashed(engine: Engine) -> None:
    # All grains in one place: no result can come of that.
    packing = lattice(30, across=4, z=1.3 * R)
    squeezed = Packing(packing.positions * 0.05 + [0, 0, 2 * R], packing.orientations)
    setup = setup_of(line_of(5), squeezed, box(16 * R, 12 * R, floor=True), duration=0.2)
    movement = engine.move(setup, time_limit_s=LIMIT_S)
    assert movement.status == "crashed"
    assert movement.why


@on_every_engine
def test_engines_name_themselves_and_their_version(engine: Engine) -> None:
    assert engine.name
    assert engine.cost_factor > 0
    assert any(c.isdigit() for c in engine.version())
