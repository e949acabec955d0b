"""From a finished calibration of a scene to its material file."""

from collections.abc import Sequence
from dataclasses import asdict, replace

from fidelity.rig import PARAMETERS, RigLevel, SceneRig, effect_parameter
from mfopt.arrays import frozen
from mfopt.records.calibration import Found, Summary
from mfopt.study.case import AssembledCase
from mfopt.study.held import Held, held, is_apparatus
from mfopt.study.material_file import MaterialSettings, material_of_tables

STIFFER = 2.0  # by which the Young modulus may differ where it was not fitted


def calibrated_material(its: Summary, parts: AssembledCase) -> MaterialSettings | None:
    """The material that a calibration found.

    The value is the mean of the posterior, as `mfopt calibrate` prints it. Parameters of the
    machine, such as a tilt, are left out.

    Returns:
        None for a simulator of the user's own, if the fitted recordings have different grains, or
        if all parameters are of the machine.
    """
    if not isinstance(parts.rig, SceneRig):
        return None
    simulated = _simulated(its.parameters, parts)
    values = {_named(p.name): p for p in its.parameters if p.asked and not _of_the_machine(p.name)}
    if len(simulated) > 1 or not values:
        return None
    (common,) = simulated
    tables = {
        "format": 1,
        "case": parts.case.name,
        "recordings": [recording.name for recording in parts.case.fitted],
        "fits": its.fits,
        "probability": its.probability,
        "values": {
            name: {
                "value": p.mean, "low": p.interval[0], "high": p.interval[1], "unit": p.unit,
                "determined": p.determined,
            }
            for name, p in values.items()
        },
        "holds_for": {
            **asdict(common),
            "young_modulus_pa": _stiffness(its.parameters, common),
            "coarse": parts.rig.coarse,
            "engine": parts.rig.engine.name,
        },
    }  # fmt: skip
    return material_of_tables(tables, where=f"calibration {its.name}")


def _simulated(found: Sequence[Found], parts: AssembledCase) -> list[Held]:
    """Grains and numerics of the fitted recordings at the values found, each kind once."""
    mean = frozen([p.mean for p in found])
    kinds: list[Held] = []
    for recording in parts.case.fitted:
        rig_level = parts.ladder[recording.name]
        assert isinstance(rig_level, RigLevel)
        level = rig_level.scene(mean)
        its = held(level.scene, level.scene.problem().baseline, level.dem)
        # A scene has its usual time step, and a portion a whole number of grains.
        if not any(_alike(its, other) for other in kinds):
            kinds.append(its)
    return kinds


def _alike(its: Held, other: Held) -> bool:
    """Whether two are the same but for time step and rounding of the number of grains."""
    same = replace(
        its,
        grain_length_mm=other.grain_length_mm,
        grain_width_mm=other.grain_width_mm,
    )
    return same == other and abs(its.grain_width_mm / other.grain_width_mm - 1.0) < ROUNDED


ROUNDED = 0.03  # relative: 20 grains, the fewest, have 2.5 % in mass and 1 % in size


def _stiffness(found: Sequence[Found], common: Held) -> tuple[float, float]:
    """Young modulus [Pa] from and to which the values hold."""
    stated = common.young_modulus_pa
    low, high = next((p.interval for p in found if p.name == "young_modulus"), (stated, stated))
    return min(low, stated / STIFFER), max(high, stated * STIFFER)


def _of_the_machine(name: str) -> bool:
    return name not in PARAMETERS and is_apparatus(effect_parameter(name)[0])


def _named(name: str) -> str:
    """Full name of a parameter: of an effect with one parameter a case may leave that out."""
    return name if name in PARAMETERS else ".".join(effect_parameter(name))
