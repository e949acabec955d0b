"""A scene on an engine, as a level of fidelity."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from fidelity.effects.switch import refuse_effects, with_effects
from fidelity.engine import Engine, Movement, Setup
from fidelity.engines.numba import NumbaEngine
from fidelity.grains.filling import Rained
from fidelity.grains.packing import Settled, default_cache, settled_packing
from fidelity.grains.settings import DemSettings
from fidelity.scene import Scene
from mfopt.arrays import AnyArray, Array, frozen
from mfopt.errors import ConfigError, InvalidDesign, SimulationError
from mfopt.records.outcome import Outcome


@dataclass(frozen=True, slots=True)
class SceneLevel:
    """A scene simulated by `engine` with the grains and numerics of `dem`.

    The vessel is filled by `filler`, the same for all engines: they start from one packing.

    Implements `mfopt.records.level.Level`. Work and CPU time of an outcome are those of the run;
    what a first run spent on filling is in `raw` as `settling_work` and `settling_cpu_s`, both 0
    when the packing came from the cache.
    """

    name: str
    scene: Scene
    dem: DemSettings
    engine: Engine
    cache: Path | None = None  # directory of settled packings; None for the user's cache
    snapshots: int = 0  # number of moments at which all grains are stored
    filler: Engine = field(default_factory=NumbaEngine)

    def __post_init__(self) -> None:
        refuse_effects(self.engine.name.partition("-")[0], self.dem.effects)

    def work(self, x: Array) -> float:
        """Predict the work of a run: spheres that move, times steps."""
        portion, cycle = self.scene.portion(x, self.dem), self.scene.cycle(x)
        timestep = self.engine.timestep(
            portion.grain, portion.grain_material, portion.wall_material, portion.physics
        )
        steps = cycle.duration_s / timestep
        spheres = self.dem.grains * len(portion.grain.radii)
        return cycle.share * spheres * steps * self.engine.cost_factor

    def evaluate(self, x: Array, *, seed: int) -> Outcome:
        """Run once at `x` (d,), in the units of the problem, from the packing of that seed."""
        try:
            setup, settled = self._start(x, seed)
        except InvalidDesign as error:
            return Outcome(frozen(x), self.name, seed, "invalid_design", str(error))
        except SimulationError as error:
            return Outcome(frozen(x), self.name, seed, "crashed", str(error))
        movement = self.engine.move(setup, time_limit_s=self.dem.time_limit_s)
        return self._outcome(x, seed, setup, settled, movement)

    def probe(self, x: Array, *, seed: int, share: float) -> Outcome:
        """Run the first `share` of the run at `x` (d,): whether it runs, and how fast."""
        try:
            setup, _ = self._start(x, seed)
        except InvalidDesign as error:
            return Outcome(frozen(x), self.name, seed, "invalid_design", str(error))
        except SimulationError as error:
            return Outcome(frozen(x), self.name, seed, "crashed", str(error))
        part = share * self.scene.cycle(x).duration_s
        short = replace(setup, duration=part, snapshot_times=np.empty(0), samples=None)
        movement = self.engine.move(short, time_limit_s=self.dem.time_limit_s)
        work = movement.sphere_steps * self.engine.cost_factor
        why = movement.why
        return Outcome(frozen(x), self.name, seed, movement.status, why, {}, work, movement.cpu_s)

    def _start(self, x: Array, seed: int) -> tuple[Setup, Settled | None]:
        """The run as an engine is given it, and the packing that it starts from.

        Raises:
            InvalidDesign: if the design cannot be built.
            SimulationError: if the vessel cannot be filled.
        """
        filling, settled = self.scene.filling(x, self.dem, seed), None
        if isinstance(filling, Rained):
            filling = replace(filling, setup=self._with_effects(filling.setup))
        if filling is not None:
            cache = default_cache() if self.cache is None else self.cache
            limit = self.dem.time_limit_s
            settled = settled_packing(self.filler, filling, cache, time_limit_s=limit)
        packing = None if settled is None else settled.packing
        setup = self.scene.setup(x, self.dem, packing, seed, self.snapshots)
        return self._with_effects(setup), settled

    def _with_effects(self, setup: Setup) -> Setup:
        try:
            return with_effects(setup, self.dem.effects)
        except ConfigError as error:
            raise ConfigError(f"level {self.name!r}: {error}") from error

    def _outcome(
        self, x: Array, seed: int, setup: Setup, settled: Settled | None, movement: Movement
    ) -> Outcome:
        status, why = movement.status, movement.why
        raw: dict[str, AnyArray] = {}
        if status == "finished":
            raw, wrong = self.scene.results(x, self.dem, setup, movement, seed)
            if wrong is not None:
                status, why = "crashed", wrong
            raw["settling_cpu_s"] = np.asarray(0.0 if settled is None else settled.cpu_s)
            raw["settling_work"] = np.asarray(0.0 if settled is None else settled.work)
        work = movement.sphere_steps * self.engine.cost_factor
        return Outcome(frozen(x), self.name, seed, status, why, raw, work, movement.cpu_s)
