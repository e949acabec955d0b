"""Every engine reduces the same quantities over time, and moves its grains as if it did not."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from engine_scenes import (
    ENGINES,
    LIMIT_S,
    G,
    R,
    box,
    lattice,
    level,
    line_of,
    on_every_engine,
    setup_of,
    turned,
)

from fidelity.engine import Engine, Material, Movement, Packing, Physics, Setup
from fidelity.engines.numba import NumbaEngine
from fidelity.grains.filling import Portion, filled
from fidelity.grains.grain import line_grain
from fidelity.samples import Plane, Samples, column_levels, even_columns, level_means
from fidelity.scenes.discharge.run import (
    DischargeSettings,
    discharge_samples,
    discharge_setup,
    filling_setup,
)
from mfopt.arrays import Array


@on_every_engine
def test_a_falling_grain_passes_planes_when_it_should(engine: Engine) -> None:
    planes = (Plane(0.15), Plane(0.1, (-R, R, -R, R)), Plane(-0.1))
    setup = replace(
        setup_of(
            line_of(1),
            Packing(np.array([[0.0, 0.0, 0.3], [0.1, 0.0, 0.3]]), level(2), np.array([1.0, 2.0])),
            duration=0.4,
        ),
        samples=Samples(np.linspace(0.0, 0.4, 41), planes),
    )
    kept = engine.move(setup, time_limit_s=LIMIT_S).series
    assert kept["passed"].shape == (41, 3)
    assert kept["passage_times"].shape == (3, 2)
    expected = np.sqrt(2 * (0.3 - np.array([0.15, 0.1, -0.1])) / G)
    times = np.column_stack([expected, expected])
    times[1, 1] = np.nan  # the large grain falls beside the opening
    np.testing.assert_allclose(kept["passage_times"], times, atol=1e-4)
    # The small grain is 1/9 of the mass.
    shares = (kept["sample_times"][:, None] >= expected) * [1.0, 1 / 9, 1.0]
    np.testing.assert_allclose(kept["passed"], shares, rtol=1e-12)


def falling_out() -> Setup:
    """40 grains that fall through a box without a floor, onto a plane and out."""
    setup = setup_of(
        line_of(3), lattice(40, across=4, z=2 * R), box(16 * R, 12 * R, floor=False), duration=0.2
    )
    return replace(setup, snapshot_times=np.linspace(0.02, 0.18, 9))


def samples_of(setup: Setup) -> Samples:
    return Samples(setup.snapshot_times, (Plane(0.01),), even_columns(-8 * R, 8 * R, 2 * R, -0.01))


@cache
def both(engine: Engine) -> tuple[Setup, Movement, Movement]:
    """The same run without and with samples."""
    setup = falling_out()
    sampled = replace(setup, samples=samples_of(setup))
    runs = [engine.move(s, time_limit_s=LIMIT_S) for s in (setup, sampled)]
    return sampled, runs[0], runs[1]


@on_every_engine
def test_samples_change_no_bit_of_the_movement(engine: Engine) -> None:
    _, plain, sampled = both(engine)
    assert plain.status == "finished", plain.why
    assert np.isfinite(plain.exit_times).any()
    assert not plain.series
    for name in ("exit_times", "positions", "orientations", "velocities", "angular_velocities"):
        np.testing.assert_array_equal(getattr(plain, name), getattr(sampled, name))
    for name, values in plain.snapshots.items():
        np.testing.assert_array_equal(values, sampled.snapshots[name])
    for name in ("end_time", "steps", "sphere_steps", "max_overlap", "max_kinetic_energy"):
        assert getattr(plain, name) == getattr(sampled, name)
    assert plain.energy == sampled.energy


@on_every_engine
def test_samples_say_what_snapshots_show(engine: Engine) -> None:
    setup, _, movement = both(engine)
    assert setup.samples is not None
    columns, kept, shown = setup.samples.columns, movement.series, movement.snapshots
    assert columns is not None
    taken = len(shown["snapshot_times"])
    assert taken >= 8
    np.testing.assert_array_equal(kept["sample_times"][:taken], shown["snapshot_times"])
    for i in range(taken):
        there = np.isfinite(shown["snapshot_positions"][i, :, 0])
        spheres = [
            np.column_stack([place + turned(q, setup.grain.offsets), setup.grain.radii])
            for place, q in zip(
                shown["snapshot_positions"][i, there],
                shown["snapshot_orientations"][i, there],
                strict=True,
            )
        ]
        levels = column_levels(columns, np.vstack([np.empty((0, 4)), *spheres]))
        np.testing.assert_allclose(kept["levels"][i], levels, atol=1e-9)
        above = (shown["snapshot_positions"][i, there, 2] >= 0.01).sum()
        assert kept["passed"][i, 0] == pytest.approx(1 - above / 40, abs=1e-12)
    assert kept["passed"][0, 0] < kept["passed"][-1, 0]


SLOT = DischargeSettings(length=0.06, depth=0.02, opening=0.022, fall=0.02, duration=0.6)
SOFT = Material(5e5, 0.3, math.atan(0.4), 1500.0)
# 300 spheres of 5 mm in 12 columns.
SPHERES = Portion(
    line_grain(0.005, 0.005, 1, SOFT.density),
    300,
    SOFT,
    SOFT,
    Physics(contact_law="hertz", restitution=0.6, damping=0.0),
)


@cache
def discharge(engine: Engine) -> tuple[Samples, Movement]:
    filling = filling_setup(SLOT, SPHERES, seed=1)
    packing, _ = filled(NumbaEngine(), filling, time_limit_s=LIMIT_S)
    setup = discharge_setup(SLOT, SPHERES, packing)
    samples = discharge_samples(SLOT, SPHERES, np.linspace(0.0, SLOT.duration, 61))
    return samples, engine.move(replace(setup, samples=samples), time_limit_s=LIMIT_S)


def means(samples: Samples, movement: Movement) -> Array:
    """Mean level over all columns, and over the left and right half (3, s) [m]."""
    assert samples.columns is not None
    return np.array(level_means(samples.columns, movement.series["levels"]))


def test_a_discharging_box_empties_down_to_its_shoulders() -> None:
    samples, movement = discharge(NumbaEngine())
    kept = movement.series
    assert kept["sample_times"][0] == 0.0
    np.testing.assert_allclose(kept["sample_times"], samples.times, atol=1.01e-3)
    assert kept["levels"].shape == (61, 12)
    assert kept["passed"][0, 0] == 0.0
    assert (np.diff(kept["passed"][:, 0]) >= 0.0).all()
    assert 0.4 < kept["passed"][-1, 0] < 1.0
    # The first level holds the whole portion at the density of a loose to dense packing.
    volume = means(samples, movement)[0, 0] * SLOT.length * SLOT.depth
    assert 0.4 < SPHERES.mass / SOFT.density / volume < 0.65
    # In the end nothing is above the outlet, and grains lie on the floor at both walls.
    end = kept["levels"][-1]
    assert end[[5, 6]].tolist() == [0.0, 0.0]
    assert min(end[0], end[-1]) > 0.95 * 0.005


@pytest.mark.parametrize("engine", [e for e in ENGINES if e.id == "yade"])
def test_yade_and_numba_empty_a_box_alike(engine: Engine) -> None:
    (samples, ours), (_, theirs) = discharge(NumbaEngine()), discharge(engine)
    assert theirs.status == "finished", theirs.why
    apart = np.abs(ours.series["passed"] - theirs.series["passed"])[:, 0]
    assert apart.mean() < 0.03
    levels = means(samples, ours) - means(samples, theirs)
    assert np.abs(levels).mean(axis=1).max() < 0.3 * 0.005
