"""`load_scene`: one simulation of a scene, from a notebook."""

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fidelity.level import SceneLevel
from fidelity.scene import PortionSettings, Scene, read_scene
from mfopt.arrays import Array, frozen
from mfopt.checks import number, whole
from mfopt.errors import ConfigError, SimulationError
from mfopt.records.objective import Criteria
from mfopt.records.outcome import Outcome
from mfopt.search.search import MOST_SEED
from mfopt.settings import checked, nearest
from mfopt.study.assemble import (
    DEM_NAMES,
    DemName,
    Numerics,
    engine_named,
    refuse_options,
    scene_class,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

GRAINS = 1000
MOST_DESIGN = 10_000.0  # magnitude of a design value, as in study files
WIDTH = 100  # characters of a line


@dataclass(frozen=True, slots=True, repr=False)
class LoadedScene:
    """A scene with its settings: `run()` simulates once, `print` shows the design."""

    scene: Scene

    def run(
        self,
        design: dict[str, float] | None = None,
        *,
        seed: int = 1,
        engine: DemName = "numba",
        grains: int = GRAINS,
        **numerics: Any,
    ) -> "SceneRun":
        """Simulate once.

        Args:
            design: values of variables by name, in their units; what is left out: the baseline.
            seed: of the packing.
            engine: "numba", "yade" or "bullet".
            grains: how many; the mass stays the same.
            numerics: what a level of a study file may say besides, such as `spheres_per_grain=1`
                or `effects={"tilt": {"angle": 0.1}}`; the units are those of the study file.

        Raises:
            ConfigError: if an argument is wrong, or the engine is not installed.
            SimulationError: if the run failed; the message says why.
        """
        if engine not in DEM_NAMES:
            raise ConfigError(f"engine = {engine!r} must be one of {', '.join(DEM_NAMES)}")
        settings = checked(Numerics, {"grains": grains, **numerics}, where="run")
        refuse_options([engine], settings)
        level = SceneLevel(engine, self.scene, settings, engine_named(engine, settings))
        x = self._x({} if design is None else design)
        outcome = level.evaluate(x, seed=whole("seed", seed, 0, MOST_SEED))
        if not outcome.finished:
            raise SimulationError(f"the run of {self.scene.name} failed: {outcome.why}")
        return SceneRun(self.scene.name, outcome, self.scene.criteria())

    def _x(self, design: dict[str, float]) -> Array:
        problem = self.scene.problem()
        values = dict(problem.named(problem.baseline))
        if not isinstance(design, Mapping):
            raise ConfigError(
                f"design = {design!r} must give values by name, such as "
                f"{{{problem.names[0]!r}: 1.0}}"
            )
        for name, value in design.items():
            if name not in values:
                raise ConfigError(f"there is no variable {name!r}{nearest(str(name), values)}")
            values[name] = number(name, value, -MOST_DESIGN, MOST_DESIGN)
        return frozen(list(values.values()))

    def __repr__(self) -> str:
        problem = self.scene.problem()
        said = problem.shown(problem.baseline)
        return textwrap.fill(f"scene {self.scene.name}: {said}", WIDTH, subsequent_indent="    ")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SceneRun:
    """One finished simulation of a scene."""

    name: str
    outcome: Outcome
    criteria: Criteria

    @property
    def quantities(self) -> dict[str, float]:
        """What an engineer asks of the run, SI units; by name."""
        return self.criteria.quantities_of(self.outcome)

    @property
    def series(self) -> dict[str, tuple[Array, Array]]:
        """Quantities over time: times (s,) [s] and values (s,) in SI units; by name."""
        return {its.name: its.read(self.outcome.raw) for its in self.criteria.series}

    def frame(self) -> "DataFrame":
        """The quantities over time in SI units as a pandas frame: one row a time.

        Raises:
            ConfigError: if the scene has no quantities over time.
        """
        from pandas import DataFrame

        columns = self.series
        self._refuse_without_series()
        times = np.unique(np.concatenate([t for t, _ in columns.values()]))
        made = {name: np.interp(times, t, v) for name, (t, v) in columns.items()}
        return DataFrame({"time [s]": times, **made}).set_index("time [s]")

    def plot(self) -> "Figure":
        """Draw the quantities over time, one panel each.

        Raises:
            ConfigError: if the scene has no quantities over time.
        """
        from matplotlib.figure import Figure

        its = self.criteria.series
        self._refuse_without_series()
        figure = Figure(figsize=(6.4, 1.0 + 1.7 * len(its)), layout="constrained")
        panels = figure.subplots(len(its), 1, sharex=True, squeeze=False)[:, 0]
        for panel, series in zip(panels, its, strict=True):
            times, values = series.read(self.outcome.raw)
            factor, unit = series.shown
            panel.plot(times, values * factor)
            panel.set_ylabel(f"{series.name}\n[{unit}]")
        panels[-1].set_xlabel("time [s]")
        return figure

    def _refuse_without_series(self) -> None:
        if not self.criteria.series:
            raise ConfigError(
                f"the scene {self.name} has no quantities over time; "
                "print(run) and run.quantities give its results"
            )

    def __repr__(self) -> str:
        lines = [f"run of {self.name}, seed {self.outcome.seed}, level {self.outcome.level}"]
        quantities = self.quantities
        for q in self.criteria.quantities:
            factor, unit = q.shown
            value = quantities.get(q.name)
            said = "no value" if value is None else f"{value * factor:.4g} {unit}"
            lines.append(f"{q.name}: {said}")
        lines.append(f"{self.outcome.cpu_s:.1f} s of CPU")
        return "\n".join(lines)


def load_scene(name: str, **settings: Any) -> LoadedScene:
    """A scene of mfopt for single simulations: dosing, discharge, heap or silo.

    Bounds of a search do not limit the settings.

    Args:
        name: of the scene.
        settings: of its table in a study file, such as `opening_mm=40`.

    Raises:
        ConfigError: if there is no such scene, or a setting is wrong.
    """
    scene = read_scene(scene_class(name), settings, {}, "load_scene")
    if isinstance(scene.settings, PortionSettings) and "free" not in settings:
        scene = read_scene(type(scene), settings | _around(scene.settings), {}, "load_scene")
    scene.problem()  # refuses what cannot be built
    return LoadedScene(scene)


def _around(settings: PortionSettings) -> dict[str, Any]:
    """The usual bounds, widened to the values of the settings."""
    values = settings.all_values()
    return {
        "free": {
            name: (min(low, values[name]), max(high, values[name]))
            for name, (low, high) in settings.free.items()
        }
    }
