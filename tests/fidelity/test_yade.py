"""YADE as an engine: laws of motion, walls that follow their law, runs that must not count."""

import math
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from yade_scenes import (
    BOXED,
    DENSITY,
    FALL,
    HALF_BOX,
    LIMIT_S,
    MATERIAL,
    SMOOTH,
    G,
    R,
    along_x,
    box,
    lattice,
    rice,
    single,
)

from fidelity.engine import Grain, Movement, Packing, Physics, Wall, WallMotion
from fidelity.engines.yade import engine as yade
from fidelity.engines.yade.engine import YadeEngine
from fidelity.grains.grain import line_grain
from mfopt.arrays import Array
from mfopt.errors import ConfigError

ROOT = Path(__file__).parents[2]

needs_yade = pytest.mark.skipif(
    shutil.which("yade") is None, reason="YADE is not installed (apt-get install yade)"
)
pytestmark = [pytest.mark.yade, needs_yade]


@pytest.fixture(scope="module")
def undisturbed() -> Movement:
    """A run of the grains in a box."""
    return YadeEngine().move(BOXED, time_limit_s=LIMIT_S)


@pytest.mark.parametrize("damp_gravity", [False, True])
def test_damping_slows_free_fall_only_when_asked(damp_gravity: bool) -> None:
    physics = Physics(damping=0.2, damp_gravity=damp_gravity)
    movement = YadeEngine().move(replace(FALL, physics=physics), time_limit_s=LIMIT_S)
    acceleration = (1 - 0.2) * G if damp_gravity else G
    assert movement.status == "finished"
    assert movement.exit_times[0] == pytest.approx(math.sqrt(2 * 0.4 / acceleration), rel=1e-3)
    assert movement.max_overlap == 0.0
    highest = BOXED.grain.mass * acceleration * 0.4
    assert movement.max_kinetic_energy == pytest.approx(highest, rel=0.05)


def test_grains_leave_one_by_one_and_no_longer_cost() -> None:
    heights = np.array([0.1, 0.2, 0.4])
    packing = Packing(
        np.array([(0.1 * i, 0.0, h) for i, h in enumerate(heights)]),
        np.tile([0.5, 0.5, 0.5, 0.5], (3, 1)),
    )
    movement = YadeEngine().move(replace(FALL, packing=packing), time_limit_s=LIMIT_S)
    times = np.sqrt(2 * heights / G)
    np.testing.assert_allclose(movement.exit_times, times, atol=1e-4)
    np.testing.assert_allclose(movement.velocities[:, 2], -G * times, atol=G * 2e-3)
    np.testing.assert_allclose(movement.orientations, packing.orientations, atol=1e-12)
    assert movement.end_time == pytest.approx(times[-1], abs=2e-3)
    expected = 5 * times.sum() / movement.timestep
    assert movement.sphere_steps == pytest.approx(expected, rel=0.01)


def test_mass_and_inertia_are_the_grains_own() -> None:
    # Gravity aside, an impulse J at distance a from the mass centre changes the velocity by J/m
    # and the spin by J a / I, whatever the contact: their ratio is I / (m a).
    grain = rice(transverse=2.0)
    edge = 2.0 * R  # under the last sphere alone, which touches at x = 2.5 R
    plate = Wall(
        "plate",
        np.array([(edge, -0.1, 0.0), (edge, 0.1, 0.0), (0.1, 0.0, 0.0)]),
        np.array([(0, 1, 2)]),
        SMOOTH,
    )
    setup = replace(
        BOXED,
        grain=grain,
        packing=single(0.0, 0.0, R + 0.01),
        walls=(plate,),
        grain_material=SMOOTH,
        physics=Physics(damping=0.0),
        duration=0.06,
        snapshot_times=np.array([0.05, 0.054]),
    )
    movement = YadeEngine().move(setup, time_limit_s=LIMIT_S)
    before, after = movement.snapshots["snapshot_orientations"][:, 0]
    t0, t1 = movement.snapshots["snapshot_times"]
    angle = 2 * (math.atan2(after[2], after[0]) - math.atan2(before[2], before[0]))
    spin = abs(angle) / (t1 - t0)
    change = movement.velocities[0, 2] + G * movement.end_time
    assert spin > 10.0
    assert change / spin == pytest.approx(grain.inertia[1] / (grain.mass * 2.5 * R), rel=0.03)


def test_a_grain_described_in_another_frame_moves_alike() -> None:
    # The same body, its long axis called y or z instead of x, its moments permuted to match.
    half = math.sqrt(0.5)
    tilt = np.array([math.cos(0.2), 0.1, math.sin(0.2), 0.0])
    y_to_x = np.array([half, 0.0, 0.0, -half])
    z_to_x = np.array([half, 0.0, half, 0.0])
    along_x = replace(BOXED, packing=single(0.0, 0.0, 0.02, unit(tilt)), duration=0.1)
    expected = YadeEngine().move(along_x, time_limit_s=LIMIT_S)
    for axis, turn in ((1, y_to_x), (2, z_to_x)):
        packing = single(0.0, 0.0, 0.02, unit(product(tilt, turn)))
        setup = replace(along_x, grain=rice(axis), packing=packing)
        movement = YadeEngine().move(setup, time_limit_s=LIMIT_S)
        np.testing.assert_allclose(movement.positions, expected.positions, atol=1e-9)
        np.testing.assert_allclose(movement.velocities, expected.velocities, atol=1e-6)


def unit(quaternion: Array) -> Array:
    return np.asarray(quaternion / np.linalg.norm(quaternion))


def product(p: Array, q: Array) -> Array:
    """The rotation `q`, then `p`."""
    vector = p[0] * q[1:] + q[0] * p[1:] + np.cross(p[1:], q[1:])
    return np.array([p[0] * q[0] - p[1:] @ q[1:], *vector])


def test_grain_whose_axes_are_not_those_of_its_spheres_is_refused() -> None:
    bent = replace(rice(), offsets=rice().offsets + np.outer([1, 0, 0, 0, -1], [0, R, 0]))
    movement = YadeEngine().move(replace(FALL, grain=bent), time_limit_s=LIMIT_S)
    assert movement.status == "crashed"
    assert "principal axes" in (movement.why or "")


def test_moving_walls_follow_the_law_and_take_the_grains_along() -> None:
    times = np.linspace(0.0, 0.2, 41)
    motion = along_x(times, 0.05 * (1 - np.cos(np.pi * times / 0.2)))
    setup = replace(BOXED, walls=(box(motion=motion),), duration=0.4, packing=lattice(12))
    movement = YadeEngine().move(setup, time_limit_s=LIMIT_S)
    assert movement.status == "finished"
    assert np.isnan(movement.exit_times).all()
    assert (np.abs(movement.positions[:, 0] - 0.1) < HALF_BOX).all()


def test_sphere_pushed_by_a_wall_is_where_the_wall_is() -> None:
    # A wall that accelerates steadily pushes with m a, so the overlap is m a / k_n.
    grain = Grain(np.zeros((1, 3)), np.array([R]), 4.7e-5, np.full(3, 7.5e-11))
    times = np.linspace(0.0, 0.2, 201)
    plate = Wall(
        "plate",
        np.array([(-R, -0.1, -0.1), (-R, 0.1, -0.1), (-R, 0.0, 0.2)]),
        np.array([(0, 1, 2)]),
        MATERIAL,
        along_x(times, 0.5 * 4.0 * times**2),  # 4 m/s2
    )
    setup = replace(
        BOXED,
        grain=grain,
        packing=single(0.0, 0.0, 0.0),
        walls=(plate,),
        physics=Physics(gravity=0.0, damping=0.3),
        duration=0.19,
    )
    movement = YadeEngine().move(setup, time_limit_s=LIMIT_S)
    assert movement.status == "finished"
    reached = 0.5 * 4.0 * movement.end_time**2
    assert movement.positions[0, 0] == pytest.approx(reached, abs=1e-4)
    assert movement.velocities[0, 0] == pytest.approx(4.0 * movement.end_time, rel=0.05)


def test_a_wall_that_turns_about_its_own_middle_meets_what_is_in_its_way() -> None:
    # A sphere at rest; nothing but the turn says that the wall comes.
    corners = np.array([(-0.2, -0.2, 0.0), (0.2, -0.2, 0.0), (0.0, 0.2, 0.0)])
    sides = np.linalg.norm(corners[[1, 2, 0]] - corners[[2, 0, 1]], axis=1)
    middle = tuple((sides @ corners / sides.sum()).tolist())  # of the inscribed circle
    rate, times = 2.0, np.array([0.0, 1.0])
    turn = WallMotion(times, np.zeros((2, 3)), -rate * times, (0.0, 1.0, 0.0), middle)
    flap = Wall("flap", corners, np.array([(0, 1, 2)]), SMOOTH, turn)
    place = np.array([0.12, -0.1, 0.03])
    distance = math.hypot(place[0], place[2])
    meeting = (math.atan2(place[2], place[0]) - math.asin(R / distance)) / rate
    setup = replace(
        BOXED,
        grain=line_grain(2 * R, 2 * R, 1, DENSITY),
        packing=single(*place),
        walls=(flap,),
        physics=Physics(gravity=0.0, damping=0.0),
        duration=meeting + 0.02,
        snapshot_times=np.array([meeting - 0.002]),
    )
    movement = YadeEngine().move(setup, time_limit_s=LIMIT_S)
    assert movement.snapshots["snapshot_speeds"][0, 0] == 0.0
    # An elastic push by a wall of speed w: 2 w.
    speed = float(np.linalg.norm(movement.velocities[0]))
    assert speed == pytest.approx(2 * rate * math.sqrt(distance**2 - R**2), rel=0.03)


def test_the_time_step_is_that_of_the_smallest_grain() -> None:
    setup = replace(BOXED, duration=0.01)
    scales = np.linspace(0.5, 1.5, 40)
    mixed = replace(setup, packing=replace(setup.packing, scales=scales))
    steps = [YadeEngine().move(s, time_limit_s=LIMIT_S).timestep for s in (setup, mixed)]
    assert steps[1] == pytest.approx(0.5 * steps[0], rel=1e-12)
    assert steps[0] == pytest.approx(0.6 * R * math.sqrt(DENSITY / 1e6), rel=1e-12)


def test_runs_repeat_bit_for_bit_and_a_trace_changes_nothing(
    undisturbed: Movement, tmp_path: Path
) -> None:
    engine, first = YadeEngine(trace=tmp_path / "trace"), undisturbed
    second = engine.move(BOXED, time_limit_s=LIMIT_S)
    for field in ("positions", "orientations", "velocities"):
        assert np.array_equal(getattr(first, field), getattr(second, field))
    assert first.sphere_steps == second.sphere_steps
    assert len(list((tmp_path / "trace").glob("spheres.*.vtu"))) >= 10
    assert engine == YadeEngine()


def test_no_folder_of_yade_is_left() -> None:
    def folders() -> set[Path]:
        return set(Path("/tmp").glob("yade-*"))  # YADE has this path in its source

    others = folders()
    YadeEngine().move(FALL, time_limit_s=LIMIT_S)
    until = time.monotonic() + 30.0  # another YADE has one while it starts
    while folders() - others and time.monotonic() < until:
        time.sleep(0.1)
    assert folders() <= others


def test_settling_ends_at_rest() -> None:
    setup = replace(BOXED, settle=True, duration=3.0)
    movement = YadeEngine().move(setup, time_limit_s=LIMIT_S)
    assert movement.status == "finished"
    assert movement.end_time < 3.0
    assert np.linalg.norm(movement.velocities, axis=1).mean() < 0.01
    assert (movement.positions[:, 2] > 0.5 * R).all()
    assert (np.abs(movement.positions[:, :2]) < HALF_BOX).all()


def test_idle_run_ends_early() -> None:
    setup = replace(BOXED, duration=5.0, idle_after=0.02, idle_above_z=0.0)
    movement = YadeEngine().move(setup, time_limit_s=LIMIT_S)
    assert movement.status == "finished"
    assert 0.02 < movement.end_time < 0.03
    below = replace(setup, idle_above_z=1.0, duration=0.05)  # now all could still pass
    assert YadeEngine().move(below, time_limit_s=LIMIT_S).end_time > 0.0499


@pytest.mark.parametrize("factor", [5.0, 8.0])
def test_unstable_time_step_is_a_crash(factor: float) -> None:
    physics = Physics(timestep_factor=factor)
    movement = YadeEngine().move(replace(BOXED, physics=physics, duration=0.3), time_limit_s=60.0)
    assert movement.status == "crashed"
    assert "exploded" in (movement.why or "")


def test_explosion_of_overlapping_grains_is_a_crash() -> None:
    near = np.array([[0.0, 0.0, 0.1], [0.0, 0.5 * R, 0.1]])
    packing = Packing(near, np.tile([1.0, 0.0, 0.0, 0.0], (2, 1)))
    movement = YadeEngine().move(replace(BOXED, packing=packing), time_limit_s=LIMIT_S)
    assert movement.status == "crashed"


def test_time_limit() -> None:
    movement = YadeEngine().move(replace(BOXED, duration=1e3), time_limit_s=4.0)
    assert movement.status == "timed_out"
    assert "4 s" in (movement.why or "")
    assert np.isnan(movement.exit_times).all()


def test_longer_words_fall_alike() -> None:
    if shutil.which("yade-longdouble") is None:
        pytest.skip("yade-longdouble is not installed")
    short = YadeEngine().move(FALL, time_limit_s=LIMIT_S)
    long = YadeEngine(precision="longdouble").move(FALL, time_limit_s=LIMIT_S)
    assert long.exit_times[0] == pytest.approx(short.exit_times[0], rel=1e-9)
    assert YadeEngine(precision="longdouble").cost_factor > YadeEngine().cost_factor


def test_missing_program_names_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(yade.PROGRAMS, "double", "yade-not-there")
    with pytest.raises(ConfigError, match="apt-get install yade"):
        YadeEngine().version()


def yade_of(keeper_parent: int) -> int | None:
    """Process id of the YADE that `keeper_parent` started; None if it is not there yet."""
    for keeper in children(keeper_parent):
        for child in children(keeper):
            words = Path(f"/proc/{child}/cmdline").read_bytes().split(b"\0")
            if any(word.endswith(b"yade/script.py") for word in words):
                return child
    return None


def children(pid: int) -> list[int]:
    found: list[int] = []
    for task in Path(f"/proc/{pid}/task").iterdir():
        found += [int(word) for word in (task / "children").read_text().split()]
    return found


def wait_for_yade(parent: int, other_than: int = 0) -> int:
    deadline = time.monotonic() + 60.0
    while (pid := yade_of(parent)) in (None, other_than):
        assert time.monotonic() < deadline
        time.sleep(0.02)
    assert pid is not None
    return pid


def test_killed_yade_is_run_once_more_with_the_same_result(undisturbed: Movement) -> None:
    results = []
    run = threading.Thread(
        target=lambda: results.append(YadeEngine().move(BOXED, time_limit_s=LIMIT_S))
    )
    run.start()
    first = wait_for_yade(os.getpid())
    os.kill(first, signal.SIGKILL)
    run.join()
    assert results[0].status == "finished"
    assert np.array_equal(results[0].positions, undisturbed.positions)


def test_yade_killed_twice_is_a_crash() -> None:
    results = []
    long = replace(BOXED, duration=1e3)
    run = threading.Thread(
        target=lambda: results.append(YadeEngine().move(long, time_limit_s=LIMIT_S))
    )
    run.start()
    first = wait_for_yade(os.getpid())
    os.kill(first, signal.SIGKILL)
    os.kill(wait_for_yade(os.getpid(), other_than=first), signal.SIGKILL)
    run.join()
    assert results[0].status == "crashed"
    assert "signal 9" in (results[0].why or "")


def test_yade_dies_with_its_caller(tmp_path: Path) -> None:
    script = (
        "from dataclasses import replace\n"
        "from yade_scenes import BOXED\n"
        "from fidelity.engines.yade.engine import YadeEngine\n"
        "YadeEngine().move(replace(BOXED, duration=1e3), time_limit_s=600.0)\n"
    )
    modules = os.pathsep.join([str(ROOT), *sys.path])
    environment = {**os.environ, "PYTHONPATH": modules, "TMPDIR": str(tmp_path)}
    caller = subprocess.Popen([sys.executable, "-c", script], env=environment)
    running = wait_for_yade(caller.pid)
    caller.kill()
    caller.wait()
    deadline = time.monotonic() + 60.0
    while Path(f"/proc/{running}").exists():
        assert time.monotonic() < deadline
        time.sleep(0.02)
