"""Effects of walls that move: a gate that takes time to open, and a rig that vibrates."""

import math
from dataclasses import replace

import numpy as np

from fidelity.effects.kinds import SetupEffect, Values
from fidelity.engine import Setup, Wall, WallMotion, sizes
from mfopt.arrays import Array, frozen
from mfopt.errors import ConfigError
from mfopt.records.effect import Effect, EffectParameter

GATE = "gate"
PER_PERIOD = 32  # samples of a vibration: a chord leaves the sine by 0.5 % of the amplitude


def _open_slowly(setup: Setup, values: Values) -> Setup:
    """The gate slides along x, and sinks by a radius so that it leaves the floor beside it."""
    gate = _gate(setup)
    opens, open_ = gate.until, gate.until + values["opening_time"]
    radius = float(setup.grain.radii.min() * sizes(setup.packing).min())
    way = np.array([float(np.ptp(gate.vertices[:, 0])), 0.0, -radius])
    times = frozen([0.0, open_] if opens == 0.0 else [0.0, opens, open_])
    steps = [np.zeros(3), way] if opens == 0.0 else [np.zeros(3), np.zeros(3), way]
    slow = replace(gate, motion=_added(gate.motion, times, np.array(steps)), until=open_)
    return replace(setup, walls=tuple(slow if wall is gate else wall for wall in setup.walls))


def _gate(setup: Setup) -> Wall:
    """The wall that closes the outlet until it opens at once."""
    named = [wall for wall in setup.walls if wall.name == GATE]
    if not named or not 0.0 <= named[0].until < math.inf:
        raise ConfigError(
            f"slow_gate: the setup has no wall {GATE!r} with a time `until` which it stays; add "
            "one, with until = 0 if it opens at the start"
        )
    return named[0]


def _vibrate(setup: Setup, values: Values) -> Setup:
    amplitude, frequency = values["amplitude"], values["frequency"]
    samples = math.ceil(PER_PERIOD * frequency * setup.duration) + 1
    times = frozen(np.arange(samples) / (PER_PERIOD * frequency))
    way = frozen(np.outer(amplitude * np.sin(2 * math.pi * frequency * times), [0.0, 0.0, 1.0]))
    # Walls that share a motion stay one surface.
    motions = {
        id(m): _added(m, times, way) for m in {id(w.motion): w.motion for w in setup.walls}.values()
    }
    return replace(
        setup, walls=tuple(replace(wall, motion=motions[id(wall.motion)]) for wall in setup.walls)
    )


def _added(motion: WallMotion | None, times: Array, way: Array) -> WallMotion:
    """The motion with displacements (m, 3) [m] added that are given at times (m,) [s]."""
    if motion is None:
        return WallMotion(times, frozen(way))
    both = np.union1d(motion.times, times)
    own = np.column_stack([np.interp(both, motion.times, c) for c in motion.displacements.T])
    more = np.column_stack([np.interp(both, times, c) for c in way.T])
    angles = motion.angles
    return replace(
        motion,
        times=frozen(both),
        displacements=frozen(own + more),
        angles=None if angles is None else frozen(np.interp(both, motion.times, angles)),
    )


SLOW_GATE = SetupEffect(
    Effect(
        "slow_gate",
        {"opening_time": EffectParameter(0.0, 0.0, 1.0, "s", "until the gate is out of the way")},
        "apparatus",
        "the gate slides along x by its length l with the speed l / opening_time, then is gone",
        "definition",
    ),
    ("numba", "yade"),
    _open_slowly,
    fills=False,
)
VIBRATION = SetupEffect(
    Effect(
        "vibration",
        {
            "amplitude": EffectParameter(0.0, 0.0, 2e-3, "m", "of all walls, along z"),
            "frequency": EffectParameter(0.0, 0.0, 100.0, "Hz", "of the sine"),
        },
        "apparatus",
        "z(t) = amplitude sin(2 pi frequency t)",
        "definition",
    ),
    ("numba", "yade"),
    _vibrate,
    fills=False,
)
