"""From a finished calibration of a scene to its material file."""

from collections.abc import Sequence, Set
from dataclasses import asdict, replace

from fidelity.rig import PARAMETERS, RigLevel, SceneRig, effect_parameter
from mfopt.arrays import Array, frozen
from mfopt.records.calibration import Summary
from mfopt.records.diagnosis import Value
from mfopt.records.level import Ladder
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
    x = frozen([p.mean for p in its.parameters])
    values = [Value(p.name, p.unit, p.mean, p.interval, p.determined) for p in its.parameters]
    asked = {p.name for p in its.parameters if p.asked}
    return material_of(values, asked, x, parts.ladder, parts, its.fits, its.probability)


def material_of(
    found: Sequence[Value],
    asked: Set[str],
    x: Array,
    ladder: Ladder,
    parts: AssembledCase,
    fits: bool,
    probability: float,
) -> MaterialSettings | None:
    """The material of values that were found.

    Args:
        found: the parameters of the simulation.
        asked: names of those that the material states; the others are not known exactly.
        x: the design (d,) of the levels at these values.
        ladder: the rig under the conditions of each recording, by its name.
        parts: the case.
        fits: whether the simulation fits with these values.
        probability: of a larger misfit.

    Returns:
        None as in `calibrated_material`.
    """
    if not isinstance(parts.rig, SceneRig):
        return None
    simulated = _simulated(x, ladder, parts)
    values = {_named(v.name): v for v in found if v.name in asked and not _of_the_machine(v.name)}
    if len(simulated) > 1 or not values:
        return None
    (common,) = simulated
    tables = {
        "format": 1,
        "case": parts.case.name,
        "recordings": [recording.name for recording in parts.case.fitted],
        "fits": fits,
        "probability": probability,
        "values": {
            name: {
                "value": v.value, "low": v.interval[0], "high": v.interval[1], "unit": v.unit,
                "determined": v.determined,
            }
            for name, v in values.items()
        },
        "holds_for": {
            **asdict(common),
            "young_modulus_pa": _stiffness(found, common),
            "coarse": parts.rig.coarse,
            "engine": parts.rig.engine.name,
        },
    }  # fmt: skip
    return material_of_tables(tables, where=f"case {parts.case.name}")


def _simulated(x: Array, ladder: Ladder, parts: AssembledCase) -> list[Held]:
    """Grains and numerics of the fitted recordings at the design `x`, each kind once."""
    kinds: list[Held] = []
    for recording in parts.case.fitted:
        rig_level = ladder[recording.name]
        assert isinstance(rig_level, RigLevel)
        level = rig_level.scene(x)
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


def _stiffness(found: Sequence[Value], common: Held) -> tuple[float, float]:
    """Young modulus [Pa] from and to which the values hold."""
    stated = common.young_modulus_pa
    low, high = next((p.interval for p in found if p.name == "young_modulus"), (stated, stated))
    return min(low, stated / STIFFER), max(high, stated * STIFFER)


def _of_the_machine(name: str) -> bool:
    return name not in PARAMETERS and is_apparatus(effect_parameter(name)[0])


def _named(name: str) -> str:
    """Full name of a parameter: of an effect with one parameter a case may leave that out."""
    return name if name in PARAMETERS else ".".join(effect_parameter(name))
