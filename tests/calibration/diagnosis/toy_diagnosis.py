"""A simulator that is linear in its parameters and effects, so that everything has a closed form.

Two channels over time; two base parameters; the effects `bend`, `twin` (which does nearly the same)
and `kick`, which acts late in one channel.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from calibration.diagnosis.diagnose import joined, suspected
from calibration.diagnosis.joint import Joint, Suspect
from calibration.diagnosis.library import Library
from calibration.diagnosis.measuring import MeasuringEffect
from calibration.diagnosis.suspects import RigEffect
from calibration.observed import Block, Observed
from calibration.recordings.case import Case, Measurement, Parameter
from mfopt.arrays import Array, frozen
from mfopt.records.rig import Channel
from surrogates.effects import Runs
from surrogates.series import SeriesEmulator, fit_effect_series

TIMES = np.linspace(0.0, 1.0, 24)
SCATTER, NOISE = 0.01, 0.005  # packing of a run, measurement
SIZES = {"bend": 0.4, "twin": 0.4, "kick": 0.3}  # at full strength
PARAMETERS = (Parameter("a", 0.0, 1.0), Parameter("b", 0.0, 1.0))
CHANNELS = {"level": Channel("level", "m", 1.0), "share": Channel("share", "-", 1.0)}
EXPERIMENTS = {"slow": 1.0, "fast": 1.6}
EFFECTS = tuple(
    RigEffect(name, name, 0.0, 0.0, size, "-", f"size of {name}", {})
    for name, size in SIZES.items()
)


def series(z: Array, sizes: Mapping[str, float], speed: float) -> Array:
    """Level and share (48,) of a run without scatter."""
    t = TIMES
    level = 1.0 - 0.5 * z[0] * speed * t
    share = 0.4 * z[1] * t + 0.2 * z[0] * t**2
    level = level + sizes.get("bend", 0.0) * np.sin(np.pi * t) * speed
    level = level + sizes.get("twin", 0.0) * np.sin(np.pi * t) ** 1.1 * speed
    share = share + sizes.get("kick", 0.0) * np.maximum(t - 0.6, 0.0)
    return np.concatenate([level, share])


def scattered(values: Array, rng: np.random.Generator) -> Array:
    """A run: slow waves of its packing are added."""
    waves = np.array([np.sin((k + 1) * np.pi * TIMES / 2.0) / (k + 1) for k in range(3)])
    return values + SCATTER * np.concatenate([rng.standard_normal(3) @ waves for _ in range(2)])


def library() -> Library:
    return Library(PARAMETERS, EFFECTS, 1)


def emulators() -> list[SeriesEmulator]:
    """Learned from the library's runs of each experiment."""
    made = []
    for number, speed in enumerate(EXPERIMENTS.values()):
        planned = library().planned(["only"], 110)
        x = np.array([c.x for c in planned])
        rng = np.random.default_rng(number)
        y = np.array(
            [scattered(series(row[:2], dict(zip(SIZES, row[2:], strict=True)), speed), rng)
             for row in x]
        )  # fmt: skip
        effect = np.full(len(x), -1)
        for place in range(len(SIZES)):
            effect[x[:, 2 + place] > 0.0] = place
        strength = np.sqrt(np.max(x[:, 2:] / np.array(list(SIZES.values())), axis=1))
        runs = Runs(frozen(x[:, :2]), effect, frozen(strength))
        made.append(fit_effect_series(runs, y, [24, 24]))
    return made


def seen(name: str, values: Array, repeats: int = 2) -> Observed:
    """A recording that is the mean of some repeats."""
    return Observed(
        name, (Block("level", TIMES), Block("share", TIMES)), frozen(values), repeats,
        frozen(NOISE**2 / repeats * np.eye(48)), np.zeros((48, 0)), 0.0, 0.0,
    )  # fmt: skip


def recorded(
    z: Sequence[float], sizes: Mapping[str, float], seed: int, stretched: float = 0.0
) -> list[Observed]:
    """Recordings of both experiments; `stretched` is the error of the length scale."""
    rng = np.random.default_rng(seed)
    made = []
    for name, speed in EXPERIMENTS.items():
        repeats = [
            scattered(series(np.array(z), sizes, speed), rng)
            * np.repeat([1.0 + stretched, 1.0], 24)
            + NOISE * rng.standard_normal(48)
            for _ in range(2)
        ]
        made.append(seen(name, np.mean(repeats, axis=0)))
    return made


def case() -> Case:
    return Case("toy", 1, {}, PARAMETERS, Measurement(), ())


def joint_of(
    its: Sequence[Observed], learned: Sequence[SeriesEmulator]
) -> tuple[Joint, tuple[Suspect, ...], tuple[MeasuringEffect, ...]]:
    """The recordings in one, and what may be missing."""
    measuring, joint = joined(case(), its, learned, CHANNELS)
    return joint, suspected(library(), measuring), measuring
