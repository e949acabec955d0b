"""The two rigs of the concealed cases: beads leave a box through a slot, or through a wedge.

Every case has the same recordings: a wide outlet, a narrow one and a partial fill, two repeats
each, and one recording that is held out.
"""

from collections.abc import Mapping

from benchmarks.calibration.experiments import Setting, table
from benchmarks.engine.scenes import engine_named
from fidelity.engine import Engine
from fidelity.rig import SceneRig
from mfopt.study.assemble import SCENES

STATED = 1e6  # [Pa] Young modulus in the case files
STIFFNESS = 6.0  # by which it may be wrong, as a case supposes
GRAINS = {"portion_kg": 0.22, "size_scatter": 0.05}
CHANNELS = ("discharged_fraction", "level_left", "level_right")
PARAMETERS = {"friction": (0.15, 0.7), "restitution": (0.5, 0.95)}
BOX = {"length_mm": 120.0, "depth_mm": 30.0, "duration_ms": 1100.0}
RIGS: Mapping[str, Mapping[str, float]] = {
    "slot": {**BOX, "floor_mm": 4.0},
    "wedge": {**BOX, "floor_angle_deg": 35.0},
}
CLOCK, ZERO = 2e-3, 5e-4  # 1 sd of the clock and of the ruler [m], as a case states them


SETTINGS = (
    Setting("wide", {"opening_mm": 40.0}, 2),
    Setting("narrow", {"opening_mm": 30.0}, 2),
    Setting("partial", {"opening_mm": 30.0, "portion_kg": 0.55 * GRAINS["portion_kg"]}, 2),
    Setting("between", {"opening_mm": 35.0}, 1, held_out=True),
)


def rig(name: str, engine: Engine, **numerics: float) -> SceneRig:
    """The rig of that name."""
    level = {"spheres_per_grain": 1, "young_modulus_pa": STATED, **numerics}
    return SceneRig(
        SCENES, "discharge", {"discharge": RIGS[name]}, GRAINS, level, engine,
        stiffness_factor=STIFFNESS,
    )  # fmt: skip


def fitted_rig(name: str) -> SceneRig:
    """The rig as a case has it, on `numba`."""
    return rig(name, engine_named("numba"))


def case_text(case: str, name: str, noises: Mapping[str, float]) -> str:
    """The case file of a rig and its recordings; `noises` are stated, by channel."""
    parts = [
        f'[case]\nname = "{case}"\nseed = 1',
        f'[rig]\nscene = "discharge"\nstiffness_factor = {STIFFNESS}',
        table("rig.discharge", RIGS[name]),
        table("rig.grains", GRAINS),
        table("rig.level", {"spheres_per_grain": 1, "young_modulus_pa": STATED}),
        *(
            f"[parameters.{its}]\nrange = [{low}, {high}]"
            for its, (low, high) in PARAMETERS.items()
        ),
        f"[measurement]\nclock_error = {CLOCK}",
    ]
    for channel in CHANNELS:
        known = {"offset": ZERO} if channel.startswith("level") else {}
        known |= {"noise": noises[channel]} if channel in noises else {}
        parts += [table(f"measurement.{channel}", known)] if known else []
    for its in SETTINGS:
        files = [file_of(its, repeat) for repeat in range(its.repeats)]
        conditions = ", ".join(f"{k} = {v}" for k, v in its.conditions.items())
        parts.append(
            f'[[recording]]\nname = "{its.name}"\nconditions = {{ {conditions} }}\n'
            f"files = {files}\nheld_out = {str(its.held_out).lower()}"
        )
    return "\n\n".join(parts) + "\n"


def file_of(setting: Setting, repeat: int) -> str:
    """Name of the file of a repeat."""
    return f"{setting.name}-{repeat + 1}.csv"
