"""Experiments whose true parameters are known: recordings made by YADE, fitted with `numba`.

    python -m benchmarks.calibration.experiments [--experiments 1-20] [--soft 1-10]

Beads of 5 mm leave a box of 120 x 30 mm through a slot. Friction, restitution and body damping are
drawn from their priors. YADE runs with another time step and other packings than the fit. The step
is shorter where the restitution is low: with 0.34 and a step of 1.3, YADE discharged 9 % less than
with 0.6, with 0.41 and body damping 0.38 2 % less. Its curves then get the errors of a camera and a
ruler. In the experiments `soft` the recorded grains are five times stiffer or softer than the case
file states. A run that is there is not run again.
"""

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import lines
from benchmarks.engine.agreement import seeds_of
from benchmarks.engine.scenes import engine_named
from fidelity.rig import SceneRig
from mfopt.arrays import Array, frozen
from mfopt.records.outcome import Outcome
from mfopt.study.assemble import SCENES, DemName

STORE = Path(__file__).parent / "results" / "experiments.jsonl"
TRUTHS: Mapping[str, tuple[float, float]] = {
    "friction": (0.1, 0.8),
    "restitution": (0.3, 0.95),
    "body_damping": (0.0, 0.5),
}
STATED = 2e6  # [Pa] Young modulus in the case file
FACTOR = 5.0  # by which the grains of the experiments `soft` are stiffer (odd) or softer (even)
STEP = 1.3  # time step of YADE over r_min sqrt(density / E); the fit takes the default of `numba`
SHORT_STEP = 0.6  # where grains bounce so little that a longer step is wrong
LEAST_BOUNCE = 0.5  # restitution from which the long step is right
HOPPER = {"length_mm": 120.0, "depth_mm": 30.0, "floor_mm": 4.0, "duration_ms": 1200.0}
GRAINS = {"portion_kg": 0.295, "size_scatter": 0.05}
FULL = GRAINS["portion_kg"]
CHANNELS = ("discharged_fraction", "level")
RATE = 80.0  # [1/s] frames
LEVEL_NOISE, FRACTION_NOISE, CORRELATION = 4e-4, 4e-3, 0.5  # [m], [-], between frames
ZERO, CLOCK = 5e-4, 2e-3  # [m] of the ruler, of the clock; 1 sd of a recording


@dataclass(frozen=True, slots=True)
class Setting:
    """One recording of every experiment."""

    name: str
    conditions: Mapping[str, float]
    repeats: int
    held_out: bool = False


SETTINGS = (
    Setting("slot30", {"opening_mm": 30.0}, 2),
    Setting("partial40", {"opening_mm": 40.0, "portion_kg": 0.6 * FULL}, 2),
    Setting("slot40", {"opening_mm": 40.0}, 1, held_out=True),
    Setting("partial30", {"opening_mm": 30.0, "portion_kg": 0.5 * FULL}, 1, held_out=True),
)


@dataclass(frozen=True, slots=True)
class Experiment:
    """The true parameters of one experiment."""

    kind: str  # recovery, or soft
    number: int

    @property
    def name(self) -> str:
        """Of its folder."""
        return f"{self.kind}-{self.number:02d}"

    @property
    def truth(self) -> Array:
        """Drawn from the priors, in the order of `TRUTHS`."""
        rng = np.random.default_rng([20, self.kind == "soft", self.number])
        low, high = np.array(list(TRUTHS.values())).T
        return frozen(low + (high - low) * rng.random(len(TRUTHS)))

    @property
    def stiffness(self) -> float:
        """Young modulus [Pa] of the recorded grains."""
        if self.kind == "recovery":
            return STATED
        return STATED * FACTOR if self.number % 2 else STATED / FACTOR

    @property
    def settings(self) -> tuple[Setting, ...]:
        """Its recordings; without those held out where only parameters are judged."""
        return tuple(s for s in SETTINGS if self.kind == "recovery" or not s.held_out)


def rig(engine: DemName = "yade", **numerics: float) -> SceneRig:
    """The hopper and its beads."""
    return SceneRig(
        SCENES,
        "discharge",
        {"discharge": HOPPER},
        GRAINS,
        {"spheres_per_grain": 1, **numerics},
        engine_named(engine),
    )


def run(experiment: Experiment, setting: Setting, repeat: int) -> Outcome:
    """One repeat of one recording, without the errors of measuring."""
    bounces = experiment.truth[list(TRUTHS).index("restitution")] >= LEAST_BOUNCE
    step = STEP if bounces else SHORT_STEP
    simulator = rig(young_modulus_pa=experiment.stiffness, timestep_factor=step)
    level = simulator.level(setting.name, setting.conditions, tuple(TRUTHS))
    place = [s.name for s in SETTINGS].index(setting.name)
    seed = 5_000_000 + 100_000 * (experiment.kind == "soft") + 1000 * experiment.number
    return level.evaluate(experiment.truth, seed=seed + 10 * place + repeat)


def make(experiments: Sequence[Experiment]) -> None:
    """Run all that is not there yet."""
    there = set(stored())
    for experiment in experiments:
        for setting in experiment.settings:
            for repeat in range(setting.repeats):
                key = (experiment.name, setting.name, repeat)
                if key not in there:
                    outcome = run(experiment, setting, repeat)
                    lines.append(STORE, _line(key, outcome))
                    print(*key, outcome.status, outcome.why, f"{outcome.cpu_s:.1f} s", flush=True)


def _line(key: tuple[str, str, int], outcome: Outcome) -> dict[str, object]:
    raw = outcome.raw
    series = {c: np.asarray(raw[c]).round(5).tolist() for c in ("time", *CHANNELS) if c in raw}
    return {"key": key, "status": outcome.status, "cpu_s": round(outcome.cpu_s, 1), **series}


def stored() -> dict[tuple[str, str, int], dict[str, list[float]]]:
    """The runs made so far, by experiment, recording and repeat."""
    return {tuple(line["key"]): line for _, line in lines.read(STORE)}


def write_case(experiment: Experiment, directory: Path) -> Path:
    """The folder of a case: recordings with the errors of a camera, and the case file.

    Raises:
        KeyError: if a run of the experiment is missing.
    """
    runs = stored()
    directory.mkdir(parents=True, exist_ok=True)
    for place, setting in enumerate(experiment.settings):
        rng = np.random.default_rng([21, experiment.kind == "soft", experiment.number, place])
        zero, clock = rng.normal(0.0, ZERO), rng.normal(0.0, CLOCK)
        for repeat in range(setting.repeats):
            its = runs[experiment.name, setting.name, repeat]
            text = recorded_text(its, rng, zero, clock)
            (directory / f"{setting.name}-{repeat + 1}.csv").write_text(text)
    path = directory / "case.toml"
    path.write_text(_case_text(experiment))
    return path


def recorded_text(
    its: Mapping[str, Any], rng: np.random.Generator, zero: float, clock: float
) -> str:
    """The text of a CSV file: a run with the errors of a camera and a ruler."""
    times = np.arange(0.0, its["time"][-1], 1.0 / RATE)
    true = {c: np.interp(times, its["time"], its[c]) for c in CHANNELS}
    level = true["level"] + zero + correlated_noise(rng, len(times), LEVEL_NOISE)
    fraction = true["discharged_fraction"] + correlated_noise(rng, len(times), FRACTION_NOISE)
    rows = [
        f"{t:.5f}, {1e3 * h:.2f}, {f:.4f}"
        for t, h, f in zip(times * (1.0 + clock), level, fraction, strict=True)
    ]
    return "\n".join(["time [s], level [mm], discharged_fraction [-]", *rows]) + "\n"


def correlated_noise(rng: np.random.Generator, count: int, sd: float) -> Array:
    """Noise (count,) that is correlated from frame to frame."""
    drawn = rng.normal(0.0, sd, count)
    for i in range(1, count):
        drawn[i] = CORRELATION * drawn[i - 1] + (1.0 - CORRELATION**2) ** 0.5 * drawn[i]
    return np.asarray(drawn)


def _case_text(experiment: Experiment) -> str:
    parts = [*case_head(experiment.name, TRUTHS), f"[measurement]\nclock_error = {CLOCK}"]
    for its in experiment.settings:
        files = [f"{its.name}-{repeat + 1}.csv" for repeat in range(its.repeats)]
        conditions = ", ".join(f"{k} = {v}" for k, v in its.conditions.items())
        parts.append(
            f'[[recording]]\nname = "{its.name}"\nconditions = {{ {conditions} }}\n'
            f"files = {files}\nheld_out = {str(its.held_out).lower()}"
        )
    return "\n\n".join(parts) + "\n"


def case_head(name: str, ranges: Mapping[str, tuple[float, float]]) -> list[str]:
    """The tables of a case before its recordings: the rig, the parameters, the ruler."""
    return [
        f'[case]\nname = "{name}"\nseed = 1',
        '[rig]\nscene = "discharge"',
        table("rig.discharge", HOPPER),
        table("rig.grains", GRAINS),
        table("rig.level", {"spheres_per_grain": 1, "young_modulus_pa": STATED}),
        *(f'[parameters."{its}"]\nrange = [{low}, {high}]' for its, (low, high) in ranges.items()),
        f'[measurement.level]\nunit = "mm"\noffset = {1e3 * ZERO}',
    ]


def table(name: str, content: Mapping[str, float]) -> str:
    return "\n".join([f"[{name}]", *(f"{key} = {value}" for key, value in content.items())])


def chosen(recovery: Sequence[str], soft: Sequence[str]) -> list[Experiment]:
    """Experiments by their numbers, such as `1-20`."""
    return [
        *(Experiment("recovery", n) for n in seeds_of(recovery)),
        *(Experiment("soft", n) for n in seeds_of(soft)),
    ]


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the experiments that the command line names."""
    parser = argparse.ArgumentParser(prog="experiments", description="recordings made by YADE")
    parser.add_argument("--experiments", nargs="*", default=["1-20"])
    parser.add_argument("--soft", nargs="*", default=["1-10"])
    given = parser.parse_args(arguments)
    make(chosen(given.experiments, given.soft))
    return 0


if __name__ == "__main__":
    sys.exit(main())
