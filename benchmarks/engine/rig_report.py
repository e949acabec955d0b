"""How far the curves of the rig differ between engines, time steps and effects."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mfopt.arrays import Array

REFERENCE, OTHER = "yade", "numba"
NONE = "none"
CHECKED = ("discharged_fraction", "level")  # channels of the comparison without an effect
SMALLEST = {"discharged_fraction": 1e-3, "level": 1e-4, "level_left": 1e-4, "level_right": 1e-4}
# [-, m] scatter below which a point in time weighs no more: the mass of two grains, a fiftieth of
# a diameter
DRAWS = 2000  # of a bootstrap over seeds


@dataclass(frozen=True, slots=True, eq=False)
class Curves:
    """The runs of one engine with one time step and one effect."""

    engine: str
    factor: float  # time step over r_min sqrt(density / E); 0: the default
    effect: str
    seeds: tuple[int, ...]
    series: Mapping[str, Array]  # by channel (seeds, s)
    cpu_s: float  # mean of a run
    timestep: float  # [s]


def report(curves: Sequence[Curves]) -> str:
    """Markdown: the bare rig at each time step, then each effect."""
    reference = min(
        (c for c in curves if c.engine == REFERENCE and c.effect == NONE), key=lambda c: c.factor
    )
    steps = [_step_row(reference, c) for c in curves if c.effect == NONE and c is not reference]
    pairs = _pairs(curves)
    return "\n".join(
        [
            f"Reference: {REFERENCE}, step factor {reference.factor:g}, "
            f"{len(reference.seeds)} seeds, {reference.cpu_s:.0f} CPU s a run.",
            "",
            "| engine | step factor | step [us] | seeds | CPU s | " + " | ".join(
                f"{c}: rms of the mean difference over one run's scatter" for c in CHECKED
            ) + " |",
            "|---|---|---|---|---|---|---|",
            *steps,
            "",
            "| effect | seeds | size over that of YADE | 95 % | size [scatters of a run] |",
            "|---|---|---|---|---|",
            *(_effect_row(*pair) for pair in pairs),
        ]
    )  # fmt: skip


def _step_row(reference: Curves, other: Curves) -> str:
    ratios = [f"{distance(reference.series[c], other.series[c], SMALLEST[c]):.2f}" for c in CHECKED]
    step = f"{other.factor:g}" if other.factor else "the default"
    return (
        f"| {other.engine} | {step} | {1e6 * other.timestep:.0f} | {len(other.seeds)} | "
        f"{other.cpu_s:.1f} | {' | '.join(ratios)} |"
    )


def distance(a: Array, b: Array, smallest: float) -> float:
    """Root mean square over time of the difference of means, over the scatter of one run.

    Args:
        a: curves of one engine (seeds, s).
        b: curves of the other.
        smallest: scatter that counts at least.
    """
    scatter = np.sqrt((a.var(axis=0, ddof=1) + b.var(axis=0, ddof=1)) / 2)
    mean = a.mean(axis=0) - b.mean(axis=0)
    return float(np.sqrt(np.mean(mean**2) / max(float(np.mean(scatter**2)), smallest**2)))


def _pairs(curves: Sequence[Curves]) -> list[tuple[str, Curves, Curves, Curves, Curves]]:
    """For each effect the curves with and without it, on either engine, with the same seeds."""
    made = []
    for effect in dict.fromkeys(c.effect for c in curves if c.effect != NONE):
        found = [_with(curves, engine, name)
                 for engine in (REFERENCE, OTHER) for name in (effect, NONE)]  # fmt: skip
        if all(c is not None for c in found):
            made.append((effect, *found))
    return made  # type: ignore[return-value]


def _with(curves: Sequence[Curves], engine: str, effect: str) -> Curves | None:
    """The curves at the largest step at which the effects of this engine were run."""
    steps = [c.factor for c in curves if c.engine == engine and c.effect != NONE]
    there = [c for c in curves if (c.engine, c.effect) == (engine, effect) and c.factor in steps]
    return max(there, key=lambda c: c.factor, default=None)


def _effect_row(effect: str, a1: Curves, a0: Curves, b1: Curves, b0: Curves) -> str:
    seeds = sorted(set(a1.seeds) & set(a0.seeds) & set(b1.seeds) & set(b0.seeds))
    unit = _scatter(a0, b0)
    moved = [_moved(with_it, without, seeds, unit) for with_it, without in ((a1, a0), (b1, b0))]
    rng = np.random.default_rng(1)
    drawn = []
    for _ in range(DRAWS):
        chosen = rng.integers(0, len(seeds), len(seeds))
        drawn.append(size_ratio(moved[0][chosen], moved[1][chosen]))
    low, high = np.quantile(drawn, [0.025, 0.975])
    ratio = size_ratio(*moved)
    size = math.sqrt(float(np.mean(moved[0].mean(axis=0) ** 2)))
    return f"| {effect} | {len(seeds)} | {ratio:.2f} | {low:.2f} to {high:.2f} | {size:.1f} |"


def _scatter(a: Curves, b: Curves) -> dict[str, float]:
    """Scatter of one run by channel, over time and both engines."""
    variances = {
        c: np.mean([its.series[c].var(axis=0, ddof=1) for its in (a, b)]) for c in SMALLEST
    }
    return {c: max(math.sqrt(v), SMALLEST[c]) for c, v in variances.items()}


def _moved(
    with_it: Curves, without: Curves, seeds: Sequence[int], unit: Mapping[str, float]
) -> Array:
    """What the effect changes, run by run, all channels in a row, in scatters of a run."""
    parts = []
    for channel in SMALLEST:
        rows = [
            curves.series[channel][[curves.seeds.index(s) for s in seeds]]
            for curves in (with_it, without)
        ]
        parts.append((rows[0] - rows[1]) / unit[channel])
    return np.concatenate(parts, axis=1)


def size_ratio(reference: Array, other: Array) -> float:
    """Size of an effect on one engine over that on the reference.

    Both are projected on the mean of both, so the scatter of neither attenuates the ratio.

    Args:
        reference: what the effect changes (seeds, p).
        other: the same on the other engine.
    """
    a, b = reference.mean(axis=0), other.mean(axis=0)
    along = a + b
    return float(np.dot(b, along) / np.dot(a, along))
