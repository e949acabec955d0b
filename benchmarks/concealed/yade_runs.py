"""The runs by YADE of a concealed case, with what it lacks."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from benchmarks.concealed.outside import AlteredYade, conditions_with
from benchmarks.concealed.rigs import CHANNELS, SETTINGS, STATED, rig
from benchmarks.concealed.truth import Truth
from calibration.diagnosis.suspects import effect_of
from mfopt.arrays import frozen
from mfopt.records.rig import TIME

STEP = 1.0  # time step over r_min sqrt(density / E); the fit takes the default of `numba`
ROLLING = "rolling_resistance"
FIRST_SEED = 7_000_000
DIGITS = 5

Runs = Mapping[str, list[Mapping[str, Any]]]


def runs_of(truth: Truth) -> tuple[Runs | None, float]:
    """Runs of each recording, and their CPU time [s]; no runs if one failed."""
    values = values_of(truth)
    engine = AlteredYade(outside=truth.outside, share=truth.share, rolling=values.pop(ROLLING, 0.0))
    simulator = rig(
        truth.rig, engine, timestep_factor=STEP, young_modulus_pa=STATED * truth.stiffness
    )
    runs: dict[str, list[Mapping[str, Any]]] = {}
    cpu_s = 0.0
    for place, setting in enumerate(SETTINGS):
        conditions = {**setting.conditions, **conditions_with(truth.outside, truth.share)}
        level = simulator.level(setting.name, conditions, tuple(values))
        for repeat in range(setting.repeats):
            seed = FIRST_SEED + (truth.seed % 100_000_000) * 10 + 2 * place + repeat
            outcome = level.evaluate(frozen(list(values.values())), seed=seed)
            cpu_s += outcome.cpu_s
            if not outcome.finished:
                return None, cpu_s
            kept = {c: np.round(outcome.raw[c], DIGITS) for c in (TIME, *CHANNELS)}
            runs.setdefault(setting.name, []).append(kept)
    return runs, cpu_s


def values_of(truth: Truth) -> dict[str, float]:
    """Values of base parameters and of the effects of the rig, by the names of its parameters."""
    effects = {
        effect_of(e).name: effect_of(e) for e in rig(truth.rig, AlteredYade()).effects.values()
    }
    values = dict(truth.base)
    for name, strength in truth.strengths.items():
        if name in effects:
            values |= effects[name].at(strength)
    return values
