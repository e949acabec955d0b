"""A scene of mfopt as the simulator of an experiment: parameters and conditions in, series out.

The grains have their real size: their number follows from the portion. A condition is a setting of
the scene, `TABLE.KEY` one in a table of the scene; the condition `scene` chooses another scene with
the same grains.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fidelity.effects.switch import EFFECTS
from fidelity.engine import Engine
from fidelity.grains.grain import grain_volume
from fidelity.grains.settings import MILLI, DemSettings
from fidelity.level import SceneLevel
from fidelity.scene import PortionSettings, Scene, read_scene
from mfopt.arrays import AnyArray, Array, frozen
from mfopt.errors import ConfigError
from mfopt.records.effect import Effect
from mfopt.records.objective import Criteria
from mfopt.records.outcome import Outcome
from mfopt.records.rig import TIME, Channel, RigParameter
from mfopt.records.view import DesignView
from mfopt.settings import checked, nearest

FEWEST_GRAINS, MOST_GRAINS = 20, 100_000
JAMMING = 5.0  # simulated grains across an outlet, below which they may jam
BESIDE = 0.1  # bounds of the one free value, over itself
SCENE = "scene"  # the condition that chooses a scene
HEAP = "heap"  # the scene that tells rolling from sliding friction
# Settings of the grains themselves, which another scene takes over where they are not 0.
OF_GRAINS = ("grain_length_mm", "grain_width_mm", "size_scatter", "grain")
# A hard contact law with a restitution, as measured for grains; no numerical damping.
NUMERICS: Mapping[str, Any] = {
    "contact_law": "hertz", "restitution": 0.7, "damping": 0.0, "young_modulus_pa": 2e6,
}  # fmt: skip

Changed = Callable[[dict[str, Any], dict[str, Any], float], None]  # of scene and numerics


def _angle(key: str) -> Changed:
    """Sets a friction angle from a friction coefficient."""

    def change(own: dict[str, Any], dem: dict[str, Any], value: float) -> None:
        angle = math.degrees(math.atan(value))
        if key == "grain":
            own["grain"] = {**own["grain"], "friction_angle_deg": angle}
        else:
            own[key] = angle

    return change


def _numeric(key: str) -> Changed:
    def change(own: dict[str, Any], dem: dict[str, Any], value: float) -> None:
        dem[key] = value

    return change


PARAMETERS: Mapping[str, tuple[RigParameter, Changed]] = {
    "friction": (
        RigParameter(0.05, 1.0, "-", "friction coefficient between grains"), _angle("grain")
    ),
    "wall_friction": (
        RigParameter(0.05, 1.0, "-", "friction coefficient of grains on walls"),
        _angle("wall_friction_angle_deg"),
    ),
    "restitution": (
        RigParameter(0.2, 0.95, "-", "speed after a bounce over that before"),
        _numeric("restitution"),
    ),
    "damping": (
        RigParameter(0.0, 0.5, "-", "numerical damping of the contacts"), _numeric("damping")
    ),
    "young_modulus": (
        RigParameter(2e5, 5e7, "Pa", "of the simulated grains", log=True),
        _numeric("young_modulus_pa"),
    ),
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class SceneRig:
    """Scenes that share grains. Implements `calibration.rig.Rig`."""

    scenes: Mapping[str, type[Scene]]  # all that there are, by name
    scene: str  # that is meant where a recording names none
    settings: Mapping[str, Mapping[str, Any]]  # tables of scenes, by name
    grains: Mapping[str, Any]  # settings of all scenes: size and material of the grains
    numerics: Mapping[str, Any]  # of `DemSettings`, without the number of grains
    engine: Engine
    coarse: float = 1.0  # diameter of the simulated grains over the real one
    stiffness_factor: float = 1.0  # by which the stated Young modulus may be wrong

    @property
    def unsure(self) -> Mapping[str, tuple[float, float]]:
        """The Young modulus [Pa]: simulated grains are softer than real ones, by choice."""
        if self.stiffness_factor == 1.0:
            return {}
        stated = float({**NUMERICS, **self.numerics}["young_modulus_pa"])
        return {"young_modulus": (stated / self.stiffness_factor, stated * self.stiffness_factor)}

    @property
    def possible(self) -> Mapping[str, Mapping[str, float | str]]:
        """Other portions, what else the scene can vary, and a heap of the same grains."""
        its = self._settings(self.scene, {})
        found: dict[str, dict[str, float | str]] = {}
        for key, shares in its.varied.items():
            for value in (share * getattr(its, key) for share in shares):
                found[f"{key} = {value:.3g}"] = {key: value}
        if self.scene != HEAP:
            found["a heap"] = {SCENE: HEAP}
        return found

    @property
    def effects(self) -> Mapping[str, Effect]:
        """All effects that the engine has, but for those of grains with another restitution.

        That effect changes a number which every run has anyway.
        """
        family = self.engine.name.partition("-")[0]
        return {
            name: its.effect
            for name, its in EFFECTS.items()
            if family in its.engines and name not in PARAMETERS
        }

    @property
    def channels(self) -> Mapping[str, Channel]:
        """Series and quantities of all scenes that the rig names."""
        found = {}
        for name in dict.fromkeys([self.scene, *self.settings]):
            scene = self._scene(name, {})
            criteria, size = scene.criteria(), _largest(scene)
            mass = settings_of(scene).portion_kg
            duration = scene.cycle(scene.problem().baseline).duration_s
            units = {q.name: q.unit for q in criteria.quantities}
            units |= {series.name: series.unit for series in criteria.series}
            can_vanish = {q.name for q in criteria.quantities if q.can_vanish}
            for quantity, unit in units.items():
                typical = {
                    "m": size, "s": duration, "kg/s": mass / duration,
                    "kg": mass, "rad": 1.0, "-": 1.0,
                }[unit]  # fmt: skip
                channel = channel_name(quantity)
                found[channel] = Channel(channel, unit, typical, quantity in can_vanish)
        return found

    def doubts(self, conditions: Mapping[str, float | str]) -> tuple[str, ...]:
        """Whether the simulated grains may jam in the outlet.

        Source: Zuriguel et al. 2005, doi:10.1103/PhysRevE.71.051303: spheres jam below 4.9 of their
        diameters.
        """
        kind, own = self._chosen(conditions)
        its = self._settings(kind, own)
        size = self.coarse * its.grain_length_mm
        if its.outlet_mm is None or its.outlet_mm >= JAMMING * size:
            return ()
        less = "; give a smaller `coarse`" if self.coarse > 1.0 else ""
        return (
            f"the outlet of {its.outlet_mm:g} mm is {its.outlet_mm / size:.1f} simulated grains of "
            f"{size:g} mm wide; below {JAMMING:g} they may jam, and values are those of jamming"
            f"{less}",
        )

    def parameter(self, name: str) -> RigParameter:
        """Range and unit of a parameter: of the material, or of an effect.

        Raises:
            ConfigError: if there is none of that name.
        """
        if name in PARAMETERS:
            return PARAMETERS[name][0]
        effect, its = effect_parameter(name)
        found = EFFECTS[effect].effect.parameters[its]
        return RigParameter(found.low, found.high, found.unit, f"{effect}: {found.meaning}")

    def level(
        self, name: str, conditions: Mapping[str, float | str], parameters: tuple[str, ...]
    ) -> "RigLevel":
        """The scene under these conditions.

        Raises:
            ConfigError: if a condition or a parameter is wrong.
        """
        for parameter in parameters:
            self.parameter(parameter)
        kind, own = self._chosen(conditions)
        settings = settings_of(self._scene(kind, own)).model_dump()
        level = RigLevel(name, self, kind, settings, parameters)
        level.work(frozen([self.parameter(p).low for p in parameters]))
        return level

    def _chosen(self, conditions: Mapping[str, float | str]) -> tuple[str, dict[str, float | str]]:
        """The scene that conditions choose, and the other conditions."""
        kind = str(conditions.get(SCENE, self.scene))
        return kind, {key: value for key, value in conditions.items() if key != SCENE}

    def _scene(self, kind: str, conditions: Mapping[str, Any]) -> Scene:
        """The scene, whose one design is the machine as it is given: no bounds of a search."""
        its = self._settings(kind, conditions)
        name, value = next(iter(its.all_values().items()))
        free = {name: ((1.0 - BESIDE) * value, (1.0 + BESIDE) * value)}
        own = {**its.model_dump(), "free": free}
        return read_scene(self.scenes[kind], own, {}, f"scene {kind}")

    def _settings(self, kind: str, conditions: Mapping[str, Any]) -> PortionSettings:
        """The settings of a scene under these conditions."""
        if kind not in self.scenes:
            raise ConfigError(f"there is no scene {kind!r}{nearest(kind, self.scenes)}")
        same: dict[str, Any] = {}
        if kind != self.scene:
            main = self._settings(self.scene, {}).model_dump()
            same = {key: main[key] for key in OF_GRAINS if main.get(key)}
        own = merged(merged(self.grains, same), self.settings.get(kind, {}))
        own = with_conditions(own, conditions)
        return settings_of(read_scene(self.scenes[kind], own, {}, f"scene {kind}"))


@dataclass(frozen=True, slots=True)
class RigLevel:
    """A scene under fixed conditions; its design are the parameters. A `Level`."""

    name: str
    rig: SceneRig
    kind: str
    settings: Mapping[str, Any]  # of the scene, as a table in which parameters can be set
    parameters: tuple[str, ...]

    def work(self, x: Array) -> float:
        """Predicted work of a run."""
        level, design = self._level(x)
        return level.work(design)

    def evaluate(self, x: Array, *, seed: int) -> Outcome:
        """Run once with the parameters `x` (d,); values that exclude each other fail."""
        try:
            level, design = self._level(x)
            outcome = level.evaluate(design, seed=seed)
        except ConfigError as error:
            return Outcome(frozen(x), self.name, seed, "invalid_design", str(error))
        raw = series_of(level.scene.criteria(), outcome) if outcome.finished else {}
        return replace(outcome, x=frozen(x), raw=raw)

    def pictured(
        self, x: Array, *, seed: int, moments: int
    ) -> tuple[Mapping[str, AnyArray], DesignView]:
        """Raw results of a run with all grains at so many moments, and the machine around them."""
        level, design = self._level(x)
        outcome = replace(level, snapshots=moments).evaluate(design, seed=seed)
        return outcome.raw, level.scene.view(design, level.dem)

    def scene(self, x: Array) -> SceneLevel:
        """The level of the scene with the parameters `x` (d,) set."""
        return self._level(x)[0]

    def _level(self, x: Array) -> tuple[SceneLevel, Array]:
        own = dict(self.settings)
        dem: dict[str, Any] = {**NUMERICS, **self.rig.numerics}
        dem["effects"] = {name: dict(v) for name, v in dem.get("effects", {}).items()}
        for name, value in zip(self.parameters, map(float, x), strict=True):
            set_parameter(name, value, own, dem)
        scene = read_scene(self.rig.scenes[self.kind], own, {}, f"scene {self.kind}")
        dem.setdefault("spheres_per_grain", 5)
        dem["grains"] = _count(settings_of(scene), int(dem["spheres_per_grain"]), self.rig.coarse)
        settings = checked(DemSettings, dem, where="rig.level")
        level = SceneLevel(self.name, scene, settings, self.rig.engine)
        return level, scene.problem().baseline


def settings_of(scene: Scene) -> PortionSettings:
    """The settings of a scene that can be a rig.

    Raises:
        ConfigError: if the scene does not say what a portion is.
    """
    if not isinstance(scene.settings, PortionSettings):
        raise ConfigError(
            f"the scene {scene.name!r} cannot be calibrated: its settings have no portion; "
            "derive them from `PortionSettings`"
        )
    return scene.settings


def merged(first: Mapping[str, Any], then: Mapping[str, Any]) -> dict[str, Any]:
    """Both tables; where both have a value the second one counts, key by key in tables of them."""
    made = dict(first)
    for key, value in then.items():
        there = made.get(key)
        if isinstance(there, Mapping) and isinstance(value, Mapping):
            made[key] = merged(there, value)
        else:
            made[key] = value
    return made


def with_conditions(own: Mapping[str, Any], conditions: Mapping[str, Any]) -> dict[str, Any]:
    """The table of a scene with these conditions; `TABLE.KEY` is set in a table of that one."""
    made = dict(own)
    for name, value in conditions.items():
        table, _, key = name.rpartition(".")
        if table:
            there = made.get(table)
            made[table] = {**(there if isinstance(there, Mapping) else {}), key: value}
        else:
            made[name] = value
    return made


def channel_name(quantity: str) -> str:
    """Name of a quantity in recordings: `discharged fraction` is `discharged_fraction`."""
    return quantity.replace(" ", "_")


def series_of(criteria: Criteria, outcome: Outcome) -> dict[str, AnyArray]:
    """Series and numbers of a finished run by channel, all series at the times `time` (s,)."""
    raw: dict[str, AnyArray] = {}
    for its in criteria.series:
        raw[TIME], raw[channel_name(its.name)] = its.read(outcome.raw)
    for name, value in criteria.quantities_of(outcome).items():
        raw[channel_name(name)] = np.asarray(value)
    return raw


def set_parameter(name: str, value: float, own: dict[str, Any], dem: dict[str, Any]) -> None:
    """Set a parameter in the tables of a scene and of a level's numerics, which are changed.

    Args:
        name: of the parameter.
        value: SI units.
        own: of the scene, with the table `grain`, which is replaced.
        dem: of the level, with the table `effects`, whose tables are changed.
    """
    if name in PARAMETERS:
        PARAMETERS[name][1](own, dem, value)
    else:
        effect, its = effect_parameter(name)
        dem["effects"].setdefault(effect, {})[its] = value


def effect_parameter(name: str) -> tuple[str, str]:
    """Effect and parameter that `EFFECT` or `EFFECT.PARAMETER` names.

    Raises:
        ConfigError: if there is none, or the effect has several and none is named.
    """
    effect, _, its = name.partition(".")
    if effect not in EFFECTS:
        raise ConfigError(f"there is no parameter {name!r}{nearest(name, [*PARAMETERS, *EFFECTS])}")
    parameters = EFFECTS[effect].effect.parameters
    main = [key for key, value in parameters.items() if not value.shapes]
    if not its and len(main) == 1:
        return effect, main[0]
    if its not in parameters:
        names = ", ".join(f"{effect}.{key}" for key in parameters)
        raise ConfigError(f"parameter {name!r} must be one of {names}")
    return effect, its


def _count(its: PortionSettings, spheres: int, coarse: float) -> int:
    """How many grains of the real size, or `coarse` times it, the portion has.

    Raises:
        ConfigError: if they are too few or too many.
    """
    length, width = MILLI * its.grain_length_mm, MILLI * its.grain_width_mm
    mass = its.grain.density_kg_m3 * coarse**3 * grain_volume(length, width, spheres)
    count = round(its.portion_kg / mass)
    if not FEWEST_GRAINS <= count <= MOST_GRAINS:
        raise ConfigError(
            f"portion_kg = {its.portion_kg:g} is {count} grains, which must be "
            f"{FEWEST_GRAINS} to {MOST_GRAINS}; "
            "change the portion, the grains' size, or `coarse` (simulated over real diameter)"
        )
    return count


def _largest(scene: Scene) -> float:
    """Largest extent of the machine [m]."""
    meshes = scene.meshes(scene.problem().baseline).values()
    return max(float(np.ptp(mesh.vertices, axis=0).max()) for mesh in meshes)
