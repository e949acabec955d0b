"""A study takes a material file: its values are set, unless the study disagrees with them.

A value that the study gives itself is refused: nobody could tell which one is meant. What the
values hold for must agree (`mfopt.study.agreement`).
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fidelity.rig import set_parameter
from fidelity.scene import Scene
from mfopt.errors import ConfigError
from mfopt.names import with_unit
from mfopt.records.calibration import chance
from mfopt.study.agreement import disagreements
from mfopt.study.assemble import DemLevelSettings, level_settings, scene_class, scene_of
from mfopt.study.file import Study, read_study
from mfopt.study.material_file import MaterialSettings, read_material

REMEDY = (
    "set in the study what the material holds for, or calibrate again with what the study "
    "simulates ([rig.level] and [rig.grains] of the case)"
)


@dataclass(frozen=True, slots=True)
class Taken:
    """The material that a study takes."""

    file: str  # as the study names it
    material: MaterialSettings
    warnings: tuple[str, ...]

    @property
    def words(self) -> list[str]:
        """The file, the values and the warnings, one sentence a line."""
        its = self.material
        said = ", ".join(
            f"{name} = {with_unit(v.value, v.unit)} (90 % {v.low:.3g} to {v.high:.3g})"
            for name, v in its.values.items()
        )
        return [
            f"{self.file}, calibration {its.case}: {said}",
            *(f"warning: {warning}" for warning in self.warnings),
        ]


def read_with_material(path: Path) -> tuple[Study, str, Taken | None]:
    """Read a study file and the material file that it names, if any, relative to itself.

    Returns:
        The study with the values of the material set, its text as given, and the material.

    Raises:
        ConfigError: if a file is wrong, or the material does not hold for the study.
    """
    study, text = read_study(path)
    if study.material is None:
        return study, text, None
    material = read_material(path.parent / study.material)
    if not material.fits:
        raise ConfigError(
            f"{path}: material {study.material} has fits = false: the simulation does not fit the "
            f"recordings of {material.case} (probability {chance(material.probability)}), so the "
            "values are those of a wrong model; calibrate again with the physics that is missing"
        )
    _refuse_both(study, material, str(path))
    made = with_material(study, material, where=str(path))
    _refuse_others(made, material, str(path))
    return made, text, Taken(study.material, material, tuple(_warnings(made, material)))


def with_material(study: Study, material: MaterialSettings, *, where: str) -> Study:
    """The study with the values of the material set, on the scene and on all levels of grains.

    Raises:
        ConfigError: if the study has no scene.
    """
    kind = _kind(study, where)
    own = _scene_table(study, kind, where)
    levels = []
    for table in study.level:
        if not _has_grains(table, where):
            levels.append(table)
            continue
        dem = {**table, "effects": {n: dict(v) for n, v in table.get("effects", {}).items()}}
        for name, found in material.values.items():
            set_parameter(name, found.value, own, dem)
        levels.append(dem)
    problem = study.problem.model_copy(update={kind.name: own})
    return study.model_copy(update={"problem": problem, "level": levels})


def _kind(study: Study, where: str) -> type[Scene]:
    if study.problem.scene is None:
        raise ConfigError(
            f"{where}: material needs a scene in [problem]; a problem of your own has no grains"
        )
    try:
        return scene_class(study.problem.scene)
    except ConfigError as error:
        raise ConfigError(f"{where}: problem.scene: {error}") from error


def _scene_table(study: Study, kind: type[Scene], where: str) -> dict[str, Any]:
    """The scene's table with a table `grain`, in which values may be left out."""
    own = study.problem.others.get(kind.name, {})
    tables = [own, *(own.get(key, {}) for key in ("grain", "wall") if isinstance(own, Mapping))]
    if not all(isinstance(table, Mapping) for table in tables):
        raise ConfigError(f"{where}: problem.{kind.name}, its grain and wall must be tables")
    return {**own, "grain": dict(own.get("grain", {}))}


def _has_grains(table: Mapping[str, Any], where: str) -> bool:
    return isinstance(level_settings(table, f"{where}: level"), DemLevelSettings)


def _refuse_both(study: Study, material: MaterialSettings, where: str) -> None:
    """Refuse values that the study gives although the material has them.

    Raises:
        ConfigError: names all of them.
    """
    kind = _kind(study, where)
    own, found = study.problem.others.get(kind.name, {}), []
    for name, its in material.values.items():
        scene: dict[str, Any] = {"grain": {}}
        dem: dict[str, Any] = {"effects": {}}
        set_parameter(name, its.value, scene, dem)
        if isinstance(own, Mapping):
            found += [f"problem.{kind.name}.{key} ({name})" for key in _shared(scene, own)]
        for table in study.level:
            keys = _shared(dem, table)
            found += [f"{key} of level {table.get('name')!r} ({name})" for key in keys]
    if found:
        raise ConfigError(
            f"{where}: the study gives {', '.join(found)}, and so does material {study.material}; "
            "leave it out of one of the two"
        )


def _shared(made: Mapping[str, Any], given: Mapping[str, Any]) -> Iterator[str]:
    """Keys, by their path, that both tables have."""
    for key, value in made.items():
        if isinstance(value, Mapping):
            below = given.get(key)
            if isinstance(below, Mapping):
                yield from (f"{key}.{path}" for path in _shared(value, below))
        elif key in given:
            yield key


def _refuse_others(study: Study, material: MaterialSettings, where: str) -> None:
    """Refuse a study that simulates something else than what the material holds for.

    Raises:
        ConfigError: names each value, on both sides.
    """
    settings = [level_settings(table, f"{where}: level") for table in study.level]
    levels = [level for level in settings if isinstance(level, DemLevelSettings)]
    if not levels:
        raise ConfigError(f'{where}: material needs a level of grains, such as engine = "numba"')
    scene = scene_of(study.problem, where)
    assert scene is not None
    by_name = {level.name: level for level in levels}
    if found := disagreements(scene, by_name, material.holds_for):
        raise ConfigError(
            f"{where}: material {study.material} does not hold for this study. {'; '.join(found)}. "
            f"Remedy: {REMEDY}"
        )


def _warnings(study: Study, material: MaterialSettings) -> Iterator[str]:
    for name, found in material.values.items():
        if not found.determined:
            yield (
                f"{name} = {found.value:g} was not determined by the recordings of "
                f"{material.case}; anything from {found.low:.3g} to {found.high:.3g} fits them"
            )
    named = study.level[-1].get("engine")
    engine = material.holds_for.engine
    if engine not in (named if isinstance(named, list) else [named]):
        yield f"the material was calibrated on {engine}, and the target runs on {named}"
