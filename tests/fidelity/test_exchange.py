"""Setup and movement survive their way through files, and a torn result is none."""

import json
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fidelity.engine import BodyForce, Material, Packing, Physics, Setup, Wall, WallMotion
from fidelity.engines.elsewhere import failed_movement
from fidelity.engines.exchange import (
    read_movement,
    read_setup,
    write_movement,
    write_setup,
)
from fidelity.grains.grain import line_grain
from fidelity.samples import Plane, Samples, even_columns

RNG = np.random.default_rng(3)


STEEL = Material(1e8, 0.2, 0.3, 7800.0)
RUBBER = Material(1e6, 0.45, 0.9, 1100.0)
SAMPLES = Samples(
    np.array([0.0, 0.3]),
    (Plane(-0.1), Plane(0.0, (-0.1, 0.2, -0.3, 0.4))),
    even_columns(-0.1, 0.1, 0.03, floor=0.004),
)


def a_setup(*, full: bool) -> Setup:
    """A setup with all that it may hold, or with all left out that can be."""
    corners, times = RNG.normal(size=(4, 3)), np.linspace(0, 1, 5)
    slide = WallMotion(times, RNG.normal(size=(5, 3)))
    tilt = WallMotion(times, slide.displacements, times**2, (0.6, 0.0, 0.8), (0.1, 0.2, 0.3))
    jet = BodyForce((0.0, 0.0, 0.0), (1.0, 2.0, 3.0), (0.5, 0.0, -0.5))
    return Setup(
        grain=line_grain(0.014, 0.004, 5, 1400.0),
        packing=Packing(
            RNG.normal(size=(6, 3)), RNG.normal(size=(6, 4)), RNG.random(6) if full else None
        ),
        grain_material=Material(1e6, 0.3, 0.4, 1400.0),
        walls=(
            Wall("cup", corners, np.array([[0, 1, 2], [0, 2, 3]]), STEEL, slide if full else None),
            Wall("lid", corners + 2, np.array([[0, 1, 3]]), RUBBER, tilt if full else None),
            Wall("plate", corners + 1, np.array([[0, 1, 2]]), STEEL),
        ),
        physics=Physics(
            contact_law="hertz" if full else "linear",
            restitution=0.6 if full else None,
            damping=0.125,
            damp_gravity=True,
            body_forces=(jet, jet) if full else (),
        ),
        duration=0.7,
        exit_z=-0.56,
        velocities=RNG.normal(size=(6, 3)) if full else None,
        angular_velocities=RNG.normal(size=(6, 3)) if full else None,
        settle=not full,
        idle_above_z=0.01,
        snapshot_times=np.array([0.1, 0.2]),
        samples=SAMPLES if full else None,
    )


def assert_same(one: Any, two: Any) -> None:
    if is_dataclass(one):
        assert type(one) is type(two)
        for f in fields(one):
            assert_same(getattr(one, f.name), getattr(two, f.name))
    elif isinstance(one, tuple):
        assert type(one) is type(two)
        for a, b in zip(one, two, strict=True):
            assert_same(a, b)
    else:
        assert (one is None) == (two is None)
        np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("full", [True, False])
def test_a_setup_comes_back_exactly(tmp_path: Path, full: bool) -> None:
    setup = a_setup(full=full)
    write_setup(setup, tmp_path, {"timestep": 1e-3})
    back, engine = read_setup(tmp_path)
    assert_same(setup, back)
    assert engine == {"timestep": 1e-3}


def test_a_setup_is_readable_with_plain_numpy_and_json(tmp_path: Path) -> None:
    setup = a_setup(full=True)
    write_setup(setup, tmp_path)
    packed = json.loads((tmp_path / "setup.json").read_text(encoding="utf-8"))["fields"]["setup"]
    assert packed["record"] == "Setup"
    cup, lid, _ = (wall["fields"] for wall in packed["fields"]["walls"])
    assert cup["name"] == "cup"
    assert lid["material"]["fields"]["friction_angle"] == 0.9
    assert lid["motion"]["fields"]["axis"] == [0.6, 0.0, 0.8]
    with np.load(tmp_path / "setup.npz", allow_pickle=False) as arrays:
        np.testing.assert_array_equal(arrays[cup["vertices"]["array"]], setup.walls[0].vertices)


def test_a_movement_comes_back_exactly(tmp_path: Path) -> None:
    movement = replace(
        failed_movement(a_setup(full=True), "crashed", "burst", cpu_s=1.5),
        snapshots={
            "snapshot_times": np.array([0.1]),
            "snapshot_speeds": np.full((1, 6), np.nan),
            "snapshot_wall_forces": RNG.normal(size=(1, 3, 3)),
        },
        angular_velocities=RNG.normal(size=(6, 3)),
        energy={"lost": 0.5},
        series={
            "sample_times": np.array([0.0, 0.3]),
            "passed": RNG.random((2, 2)),
            "passage_times": np.array([[np.nan, 0.1], [0.2, 0.3]]),
            "levels": RNG.random((2, 7)),
        },
        steps=12,
    )
    write_movement(movement, tmp_path)
    back = read_movement(tmp_path, cpu_s=1.5)
    assert back is not None
    assert back.energy == {"lost": 0.5}
    bare, back_bare = (replace(m, snapshots={}, series={}, energy={}) for m in (movement, back))
    assert_same(bare, back_bare)
    for one, two in ((movement.snapshots, back.snapshots), (movement.series, back.series)):
        assert list(one) == list(two)
        assert_same(tuple(one.values()), tuple(two.values()))


def test_a_missing_or_torn_result_is_none(tmp_path: Path) -> None:
    assert read_movement(tmp_path, cpu_s=0.0) is None
    write_movement(failed_movement(a_setup(full=False), "crashed", "", cpu_s=0.0), tmp_path)
    whole = (tmp_path / "result.npz").read_bytes()
    (tmp_path / "result.npz").write_bytes(whole[: len(whole) // 2])
    assert read_movement(tmp_path, cpu_s=0.0) is None


def test_a_result_that_is_no_movement_is_none(tmp_path: Path) -> None:
    write_setup(a_setup(full=False), tmp_path)
    for kind in ("json", "npz"):
        (tmp_path / f"setup.{kind}").rename(tmp_path / f"result.{kind}")
    assert read_movement(tmp_path, cpu_s=0.0) is None
