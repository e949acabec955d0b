"""Setup and movement survive their way through files, and a torn result is none."""

import json
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fidelity.engine import Material, Packing, Physics, Setup, Wall, WallMotion
from fidelity.exchange import (
    failed_movement,
    read_movement,
    read_setup,
    write_movement,
    write_setup,
)
from fidelity.grain import line_grain

RNG = np.random.default_rng(3)


def a_setup(*, moving: bool) -> Setup:
    corners = RNG.normal(size=(4, 3))
    return Setup(
        grain=line_grain(0.014, 0.004, 5, 1400.0),
        packing=Packing(RNG.normal(size=(6, 3)), RNG.normal(size=(6, 4))),
        grain_material=Material(1e6, 0.3, 0.4, 1400.0),
        wall_material=Material(1e8, 0.2, 0.3, 7800.0),
        walls=(
            Wall("cup", corners, np.array([[0, 1, 2], [0, 2, 3]]), moves=moving),
            Wall("plate", corners + 1, np.array([[0, 1, 2]])),
        ),
        physics=Physics(damping=0.125, damp_gravity=True),
        duration=0.7,
        exit_z=-0.56,
        motion=WallMotion(np.linspace(0, 1, 5), RNG.normal(size=5)) if moving else None,
        settle=not moving,
        idle_above_z=0.01,
        snapshot_times=np.array([0.1, 0.2]),
    )


def assert_same(one: Any, two: Any) -> None:
    if is_dataclass(one):
        assert type(one) is type(two)
        for f in fields(one):
            assert_same(getattr(one, f.name), getattr(two, f.name))
    elif isinstance(one, tuple):
        for a, b in zip(one, two, strict=True):
            assert_same(a, b)
    else:
        np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("moving", [True, False])
def test_a_setup_comes_back_exactly(tmp_path: Path, moving: bool) -> None:
    setup = a_setup(moving=moving)
    write_setup(setup, tmp_path, {"timestep": 1e-3})
    back, engine = read_setup(tmp_path)
    assert_same(setup, back)
    assert engine == {"timestep": 1e-3}


def test_a_setup_is_readable_with_plain_numpy_and_json(tmp_path: Path) -> None:
    setup = a_setup(moving=True)
    write_setup(setup, tmp_path)
    scalars = json.loads((tmp_path / "setup.json").read_text(encoding="utf-8"))
    assert scalars["walls"] == [
        {"name": "cup", "moves": True},
        {"name": "plate", "moves": False},
    ]
    with np.load(tmp_path / "setup.npz", allow_pickle=False) as arrays:
        np.testing.assert_array_equal(arrays["wall_vertices_1"], setup.walls[1].vertices)
        assert arrays["positions"].shape == (6, 3)


def test_a_movement_comes_back_exactly(tmp_path: Path) -> None:
    movement = replace(
        failed_movement(a_setup(moving=True), "crashed", "burst", cpu_s=1.5),
        snapshots={"snapshot_times": np.array([0.1]), "snapshot_speeds": np.full((1, 6), np.nan)},
        steps=12,
    )
    write_movement(movement, tmp_path)
    back = read_movement(tmp_path, cpu_s=1.5)
    assert back is not None
    assert_same(replace(movement, snapshots={}), replace(back, snapshots={}))
    assert_same(tuple(movement.snapshots.values()), tuple(back.snapshots.values()))


def test_a_missing_or_torn_result_is_none(tmp_path: Path) -> None:
    assert read_movement(tmp_path, cpu_s=0.0) is None
    write_movement(failed_movement(a_setup(moving=False), "crashed", "", cpu_s=0.0), tmp_path)
    whole = (tmp_path / "result.npz").read_bytes()
    (tmp_path / "result.npz").write_bytes(whole[: len(whole) // 2])
    assert read_movement(tmp_path, cpu_s=0.0) is None
