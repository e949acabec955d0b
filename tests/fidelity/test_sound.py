"""What no engine can use is refused where it is made, and a result that is none is a crash."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from engine_scenes import (
    LIMIT_S,
    WALL_MATERIAL,
    R,
    box,
    lattice,
    level,
    line_of,
    on_every_engine,
    pile_in_box,
    setup_of,
)

from fidelity.engine import Engine, Packing, Wall, WallMotion, checked
from fidelity.engines.elsewhere import failed_movement
from mfopt.errors import ConfigError

GRAIN, PILE = line_of(3), lattice(4, across=2, z=R)
SOUND = setup_of(GRAIN, PILE, box(0.1, 0.1, floor=True), duration=0.01)


def with_entry(values: np.ndarray, value: float) -> np.ndarray:
    changed = values.astype(float)
    changed.flat[0] = value
    return changed


def wall(vertices: np.ndarray, triangles: object) -> Wall:
    return Wall("wall", vertices, np.array(triangles, dtype=np.int64).reshape(-1, 3), WALL_MATERIAL)


CORNERS = np.eye(3)
REFUSED: dict[str, tuple[Callable[[], object], str]] = {
    "no grain": (lambda: Packing(np.empty((0, 3)), np.empty((0, 4))), "0 grains"),
    "place": (lambda: replace(PILE, positions=with_entry(PILE.positions, np.nan)), "positions"),
    "flat place": (lambda: replace(PILE, positions=PILE.positions[:, :2]), "positions"),
    "turn": (lambda: replace(PILE, orientations=0 * PILE.orientations), "quaternions"),
    "too few turns": (lambda: replace(PILE, orientations=PILE.orientations[1:]), "orientations"),
    "scale": (lambda: replace(PILE, scales=np.array([1.0, 1.0, 0.0, 1.0])), "scales"),
    "no sphere": (lambda: replace(GRAIN, offsets=np.empty((0, 3)), radii=np.empty(0)), "0 spheres"),
    "radius": (lambda: replace(GRAIN, radii=with_entry(GRAIN.radii, -R)), "radii"),
    "mass": (lambda: replace(GRAIN, mass=0.0), "mass"),
    "inertia": (lambda: replace(GRAIN, inertia=with_entry(GRAIN.inertia, np.inf)), "inertia"),
    "corner": (lambda: wall(with_entry(CORNERS, np.nan), [0, 1, 2]), "corners of the wall 'wall'"),
    "no triangle": (lambda: wall(CORNERS, []), "'wall': its 0 triangles"),
    "index": (lambda: wall(CORNERS, [0, 1, 3]), "corners from 0 to 2"),
    "negative index": (lambda: wall(CORNERS, [0, 1, -1]), "triangles of the wall 'wall'"),
    "no time": (lambda: WallMotion(np.empty(0), np.empty((0, 3))), "0 samples"),
    "times": (lambda: WallMotion(np.array([0.0, 0.0]), np.zeros((2, 3))), "steps between times"),
    "way": (lambda: WallMotion(np.zeros(1), np.full((1, 3), np.nan)), "displacements"),
    "speed": (lambda: replace(SOUND, velocities=np.zeros((1, 3))), "velocities"),
    "spin": (lambda: replace(SOUND, angular_velocities=np.full((4, 3), np.inf)), "angular"),
    "duration": (lambda: replace(SOUND, duration=float("nan")), "duration"),
    "same place": (
        lambda: replace(SOUND, packing=Packing(np.zeros((2, 3)), level(2))),
        "two grains are at the same position",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_no_engine_can_use_is_refused(name: str) -> None:
    make, why = REFUSED[name]
    with pytest.raises(ConfigError, match=why):
        make()


@pytest.mark.parametrize("field", ["positions", "orientations", "velocities", "angular_velocities"])
def test_a_place_or_speed_that_is_not_a_number_is_a_crash(field: str) -> None:
    sound = replace(failed_movement(SOUND, "finished", "", cpu_s=0.0), why=None)
    assert checked(sound) is sound
    broken = checked(replace(sound, **{field: with_entry(getattr(sound, field), np.nan)}))
    assert broken.status == "crashed"
    assert "1 of 4 grains" in (broken.why or "")


@on_every_engine
def test_spheres_of_two_grains_in_one_place_are_a_crash(engine: Engine) -> None:
    ends = np.array([[0.0, 0.0, 0.05], [2.5 * R, 0.0, 0.05]])  # the last sphere and the first
    setup = replace(pile_in_box(0.01), grain=GRAIN, packing=Packing(ends, level(2)))
    assert engine.move(setup, time_limit_s=LIMIT_S).status == "crashed"


@on_every_engine
def test_grains_too_near_to_be_told_apart_end_with_numbers_or_a_crash(engine: Engine) -> None:
    near = Packing(np.array([[0.0, 0.0, 0.05], [1e-300, 0.0, 0.05]]), level(2))
    setup = replace(pile_in_box(0.01), grain=line_of(1), packing=near)
    movement = engine.move(setup, time_limit_s=LIMIT_S)
    assert movement.status == "crashed" or np.isfinite(movement.positions).all()
