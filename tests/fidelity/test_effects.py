"""Each effect: nothing at its null, and at a mid strength what its equation says."""

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from fidelity.effects.kinds import Values
from fidelity.effects.switch import (
    EFFECTS,
    effect_named,
    refuse_effects,
    switched_on,
    with_effects,
)
from fidelity.engine import Material, Movement, Packing, Physics, Setup, Wall, WallMotion, sizes
from fidelity.engines.numba import NumbaEngine
from fidelity.grains.filling import Portion, filled, plane
from fidelity.grains.grain import grain_volume, line_grain
from fidelity.scenes.discharge.run import (
    DischargeSettings,
    discharge_setup,
    filling_setup,
    vessel,
)
from mfopt.arrays import Array
from mfopt.errors import ConfigError

ENGINE = NumbaEngine()
LIMIT_S = 300.0
SEEDS = range(4)
G = 9.81  # [m/s2]
D = 6e-3  # [m] grain diameter

GRAINS = Material(1e6, 0.3, math.atan(0.4), 1500.0)
WALLS = Material(1e7, 0.3, math.atan(0.3), 2500.0)
HERTZ = Physics(contact_law="hertz", restitution=0.7, damping=0.0)
PORTION = Portion(line_grain(D, D, 1, GRAINS.density), 120, GRAINS, WALLS, HERTZ)
RIG = DischargeSettings(length=0.05, depth=0.025, opening=0.024, fall=0.03, duration=0.8)
NARROW = DischargeSettings(length=0.03, depth=0.018, opening=0.021, fall=0.03, duration=0.2)


def moved(setup: Setup) -> Movement:
    movement = ENGINE.move(setup, time_limit_s=LIMIT_S)
    assert movement.status == "finished", movement.why
    return movement


@cache
def packed(name: str | None, seed: int, settings: DischargeSettings = RIG) -> Packing:
    """Filled with the effect; packings that it does not change are made once."""
    effects = {} if name is None else {name: STRENGTHS[name]}
    portion = with_effects(PORTION, effects)
    loose = filling_setup(settings, portion, seed)
    filling = with_effects(loose, effects)
    if name is not None and portion is PORTION and filling is loose:
        return packed(None, seed, settings)
    return filled(ENGINE, filling, time_limit_s=LIMIT_S)[0]


@cache
def discharged(name: str | None, seed: int) -> tuple[Setup, Movement]:
    """The rig emptied with the effect, or without any."""
    effects = {} if name is None else {name: STRENGTHS[name]}
    portion = with_effects(PORTION, effects)
    setup = discharge_setup(RIG, portion, packed(name, seed), gate_until=0.0)
    setup = with_effects(setup, effects)
    return setup, moved(setup)


def mean_exit_time(name: str | None, seed: int) -> float:
    """Mean time [s] at which grains leave, those that stay counting as the end."""
    times = discharged(name, seed)[1].exit_times
    return float(np.where(np.isnan(times), RIG.duration, times).mean())


def exit_speed(name: str | None, seed: int) -> float:
    """Mean speed [m/s] with which grains leave."""
    movement = discharged(name, seed)[1]
    left = np.isfinite(movement.exit_times)
    return float(np.linalg.norm(movement.velocities[left], axis=1).mean())


def exit_place(name: str | None, seed: int) -> float:
    """Mean x [m] where grains leave."""
    movement = discharged(name, seed)[1]
    return float(movement.positions[np.isfinite(movement.exit_times), 0].mean())


def first_third(name: str | None, seed: int) -> float:
    """Time [s] until a third of the grains has left."""
    return float(np.sort(discharged(name, seed)[1].exit_times)[40])


def stays(name: str | None, seed: int) -> float:
    """Grains still there at the end."""
    return float(np.isnan(discharged(name, seed)[1].exit_times).sum())


def height_after_a_bounce(name: str | None, seed: int) -> float:
    """Mean height [m] of a layer that falls 3 cm, between its first and its third bounce."""
    portion = replace(PORTION, grains=25)
    setup = filling_setup(RIG, portion, seed)
    lifted = setup.packing.positions + np.array([0.0, 0.0, 0.03])
    floor = PORTION.wall("floor", plane(RIG.length, RIG.depth, 0.0))
    setup = replace(
        setup,
        packing=replace(setup.packing, positions=lifted),
        walls=(*vessel(RIG, portion, 0.3), floor),
        physics=portion.physics,
        settle=False,
        duration=0.3,
        snapshot_times=np.arange(0.1, 0.3, 0.02),
    )
    if name is not None:
        setup = switched_on(setup, name, STRENGTHS[name])
    return float(moved(setup).snapshots["snapshot_positions"][..., 2].mean())


def carried_by_the_front(name: str | None, seed: int) -> float:
    """Mean weight [N] that sliding grains hang on the front side."""
    values = {"excess": 1e-12} if name is None else STRENGTHS["side_wall_friction"]
    setup = discharge_setup(NARROW, PORTION, packed(None, seed, NARROW))
    setup = replace(setup, snapshot_times=np.arange(0.05, 0.2, 0.01))
    setup = switched_on(setup, "side_wall_friction", values)
    front = [wall.name for wall in setup.walls].index("hopper front")
    return -float(moved(setup).snapshots["snapshot_wall_forces"][:, front, 2].mean())


# Each effect in the middle of what is plausible, what its equation then says most directly, and
# whether that grows.
SAYS: dict[str, tuple[Values, Callable[[str | None, int], float], int]] = {
    # the large grains are larger than before
    "two_sizes": ({"small_share": 0.5, "small_ratio": 0.6}, mean_exit_time, +1),
    "grain_aspect": ({"aspect": 1.8}, mean_exit_time, +1),  # long grains interlock
    # a steeper heap stays beside the outlet
    "rolling_resistance": ({"coefficient": 0.2, "spring": 2.0}, stays, +1),
    "cohesion": ({"energy": 0.1}, mean_exit_time, +1),
    "restitution": ({"change": -0.3}, height_after_a_bounce, -1),
    "side_wall_friction": ({"excess": 0.7}, carried_by_the_front, +1),
    "drag_linear": ({"rate": 5.0}, exit_speed, -1),
    "drag_quadratic": ({"rate": 5.0}, exit_speed, -1),
    "body_damping": ({"share": 0.25}, mean_exit_time, +1),  # everything falls with 3/4 of g
    "tilt": ({"angle": 0.15}, exit_place, +1),
    "slow_gate": ({"opening_time": 0.2}, first_third, +1),
    # it loosens what would stay
    "vibration": ({"amplitude": 5e-4, "frequency": 50.0}, mean_exit_time, -1),
}
STRENGTHS = {name: values for name, (values, _, _) in SAYS.items()}


@cache
def without(observed: Callable[[str | None, int], float]) -> Array:
    return np.array([observed(None, seed) for seed in SEEDS])


@pytest.mark.parametrize("name", EFFECTS)
def test_a_mid_strength_moves_its_observable_as_its_equation_says(name: str) -> None:
    _, observed, sign = SAYS[name]
    before = without(observed)
    after = np.array([observed(name, seed) for seed in SEEDS])
    moved_by = sign * float(after.mean() - before.mean())
    # Counts that hardly scatter: at least one grain.
    scatter = max(float(before.std(ddof=1)), 1.0 if observed is stays else 0.0)
    assert moved_by > 3.0 * scatter


def nulls(name: str) -> list[Values]:
    """At null in each parameter that switches the effect, all others at their mid strength."""
    effect = effect_named(name).effect
    switches = {key: p.null for key, p in effect.parameters.items() if not p.shapes}
    return [{}, *({**STRENGTHS[name], key: null} for key, null in switches.items())]


@pytest.mark.parametrize("name", EFFECTS)
def test_at_its_null_an_effect_leaves_the_very_same_setup_and_portion(name: str) -> None:
    setup = discharge_setup(RIG, PORTION, packed(None, 0), gate_until=0.0)
    for values in nulls(name):
        assert switched_on(setup, name, values) is setup
        assert switched_on(PORTION, name, values) is PORTION
        assert with_effects(setup, {name: values}) is setup
        refuse_effects("bullet", {name: values})


def test_a_gate_that_is_gone_at_the_start_changes_nothing() -> None:
    with_gate, movement = discharged(None, 0)
    assert [wall.name for wall in with_gate.walls] == ["hopper", "gate"]
    bare = moved(discharge_setup(RIG, PORTION, packed(None, 0)))
    np.testing.assert_array_equal(movement.exit_times, bare.exit_times)
    np.testing.assert_array_equal(movement.positions, bare.positions)


def trace_of(name: str) -> Values:
    """Next to the null."""
    traces: dict[str, Values] = {
        "two_sizes": {"small_share": 0.5, "small_ratio": 1.0 - 1e-13},
        "vibration": {"amplitude": 1e-15, "frequency": 50.0},
    }
    return traces.get(name, {next(iter(STRENGTHS[name])): 1e-13 * (-1) ** (name == "restitution")})


# A gate that opens at once may not move; a second sphere in the same place makes contacts stiffer.
@pytest.mark.parametrize("name", [n for n in EFFECTS if n not in ("slow_gate", "grain_aspect")])
def test_a_trace_of_an_effect_changes_next_to_nothing(name: str) -> None:
    # Short: small differences grow exponentially in a discharge.
    portion = with_effects(PORTION, {name: trace_of(name)})
    loose = filling_setup(RIG, PORTION, 1).packing
    settings = replace(RIG, duration=0.05)
    plain = discharge_setup(settings, PORTION, loose, gate_until=0.0)
    scales = filling_setup(RIG, portion, 1).packing.scales
    setup = replace(plain, packing=replace(loose, scales=scales)) if name == "two_sizes" else plain
    changed = with_effects(setup, {name: trace_of(name)})
    assert changed is not plain
    assert moved(changed).positions == pytest.approx(moved(plain).positions, abs=1e-9)


def test_effects_act_where_they_are_there() -> None:
    filling = filling_setup(RIG, PORTION, 0)
    run = discharge_setup(RIG, PORTION, filling.packing, gate_until=0.0)
    acting = {
        name: tuple(
            with_effects(subject, {name: STRENGTHS[name]}) is not subject
            for subject in (PORTION, filling, run)
        )
        for name in EFFECTS
    }
    in_run_only = {"body_damping", "slow_gate", "vibration"}
    before_filling = {"two_sizes", "grain_aspect"}
    assert acting == {
        name: (True, False, False)
        if name in before_filling
        else (False, name not in in_run_only, True)
        for name in EFFECTS
    }


def test_two_sizes_keep_number_and_mass_and_stay_through_filling() -> None:
    portion = with_effects(PORTION, {"two_sizes": STRENGTHS["two_sizes"]})
    packing = packed("two_sizes", 0)
    scales = sizes(packing)
    assert len(scales) == portion.grains
    assert np.sum(portion.grain.mass * scales**3) == pytest.approx(PORTION.mass, rel=1e-12)
    assert scales.min() / scales.max() == pytest.approx(0.6, rel=1e-12)
    assert np.isclose(scales, scales.min()).sum() == 60


@pytest.mark.parametrize("aspect", [1.2, 1.8, 3.0])
def test_a_stretched_grain_keeps_its_mass(aspect: float) -> None:
    long = switched_on(PORTION, "grain_aspect", {"aspect": aspect})
    width = 2.0 * float(long.grain.radii.max())
    assert long.grain_length / width == pytest.approx(aspect, rel=1e-12)
    spheres = len(long.grain.radii)
    volume = grain_volume(long.grain_length, width, spheres)
    assert long.grain.mass == pytest.approx(PORTION.grain.mass, rel=1e-12)
    assert volume == pytest.approx(PORTION.grain.mass / GRAINS.density, rel=1e-12)
    again = switched_on(long, "grain_aspect", {"aspect": 1.5})
    assert again.grain_length == pytest.approx(1.5 * aspect * 2.0 * again.grain.radii.max())


def test_vibration_adds_to_the_motion_of_a_gate() -> None:
    setup = discharge_setup(RIG, PORTION, packed(None, 0), gate_until=0.1)
    both = with_effects(setup, {name: STRENGTHS[name] for name in ("vibration", "slow_gate")})
    still = with_effects(setup, {"slow_gate": STRENGTHS["slow_gate"]})
    gate, alone = (next(w for w in s.walls if w.name == "gate") for s in (both, still))
    assert gate.until == alone.until == pytest.approx(0.3)
    for t in (0.0, 0.05, 0.13, 0.25):
        sine = 5e-4 * math.sin(2 * math.pi * 50.0 * t)
        expected = displaced(alone.motion, t) + np.array([0.0, 0.0, sine])
        # A chord of 32 to the period leaves the sine by 0.5 %.
        assert displaced(gate.motion, t) == pytest.approx(expected, abs=0.005 * 5e-4)


def displaced(motion: WallMotion | None, time: float) -> Array:
    assert motion is not None
    return np.array([np.interp(time, motion.times, c) for c in motion.displacements.T])


def wall_named(setup: Setup, name: str) -> Wall:
    return next(wall for wall in setup.walls if wall.name == name)


def test_one_side_gets_a_friction_of_its_own_and_the_others_keep_theirs() -> None:
    setup = discharge_setup(RIG, PORTION, packed(None, 0))
    rough = switched_on(setup, "side_wall_friction", {"excess": 0.5})
    whole, rest = setup.walls[0], wall_named(rough, "hopper")
    front = wall_named(rough, "hopper front")
    assert len(rest.triangles) + len(front.triangles) == len(whole.triangles)
    assert (front.vertices[front.triangles][..., 1] == -RIG.depth / 2).all()
    assert front.friction_angle == pytest.approx(math.atan(0.3 + 0.5))
    assert rest.friction_angle is None
    # Once more, as a wall that lies there as a whole; the places of all walls stay.
    twice = switched_on(rough, "side_wall_friction", {"excess": 0.2})
    assert [wall.name for wall in twice.walls] == ["hopper", "hopper front"]
    assert wall_named(twice, "hopper front").friction_angle == pytest.approx(math.atan(1.0))


def test_a_vessel_without_a_flat_front_cannot_have_a_rougher_one() -> None:
    setup = discharge_setup(RIG, PORTION, packed(None, 0))
    floor = PORTION.wall("floor", plane(0.1, 0.1, 0.0))
    with pytest.raises(ConfigError, match=r"no wall is flat at the smallest y = -0\.05 m"):
        switched_on(replace(setup, walls=(floor,)), "side_wall_friction", {"excess": 0.2})


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("cohesoin", {}, "unknown effect 'cohesoin'; the nearest is 'cohesion'"),
        ("cohesion", {"enrgy": 1.0}, "the nearest is 'energy'"),
        ("two_sizes", STRENGTHS["two_sizes"], "apply it to the portion"),
        (
            "cohesion",
            {"energy": -0.1},
            "energy = -0.1 J/m2 must be at least 0; plausible is 0 to",
        ),
        ("rolling_resistance", {"coefficient": -0.1}, "coefficient = -0.1 must be at least 0"),
        ("drag_linear", {"rate": -1.0}, "effect 'drag_linear': rate = -1 1/s must be at least 0"),
        ("drag_quadratic", {"rate": -1.0}, "rate = -1 1/m must be at least 0"),
        ("slow_gate", {"opening_time": 0.1}, "has no wall 'gate'"),
        ("slow_gate", {"opening_time": -0.1}, "opening_time = -0.1 s must be at least 0"),
        ("restitution", {"change": 0.5}, "makes 1.2"),
        ("side_wall_friction", {"excess": -0.5}, "must be at least -0.3"),
        ("vibration", {"amplitude": -1e-3}, "amplitude = -0.001 m must be"),
        ("body_damping", {"share": 1.0}, "share = 1 must be"),
        ("vibration", {"amplitude": -1e-3, "frequency": 1.0}, "amplitude = -0.001 m must be"),
    ],
)
def test_what_cannot_be_is_refused_with_a_remedy(name: str, values: Values, message: str) -> None:
    setup = discharge_setup(RIG, PORTION, packed(None, 0))
    with pytest.raises(ConfigError, match=message):
        switched_on(setup, name, values)


def test_body_damping_is_refused_beside_another_numerical_damping() -> None:
    setup = discharge_setup(RIG, replace(PORTION, physics=Physics()), packed(None, 0))
    with pytest.raises(ConfigError, match=r"numerical damping = 0\.2 of its own"):
        switched_on(setup, "body_damping", {"share": 0.1})


@pytest.mark.parametrize("name", EFFECTS)
def test_engines_that_lack_an_effect_refuse_it(name: str) -> None:
    for engine in ("numba", "yade", "bullet"):
        if engine in effect_named(name).engines:
            refuse_effects(engine, {name: STRENGTHS[name]})
        else:
            with pytest.raises(ConfigError, match=f"engine {engine}: it lacks the effect {name!r}"):
                refuse_effects(engine, {name: STRENGTHS[name]})
