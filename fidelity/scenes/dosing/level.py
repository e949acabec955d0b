"""The dosing scene as a level, on any discrete-element engine."""

import logging
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from fidelity.engine import Engine, Movement, Setup
from fidelity.engines.numba import NumbaEngine
from fidelity.grains.packing import Settled, default_cache, settled_packing
from fidelity.scenes.dosing.design import MILLI, Design, design
from fidelity.scenes.dosing.run import dosing_setup, packing_order, raw_results, tally
from fidelity.scenes.dosing.settings import DemSettings, DosingSettings
from mfopt.arrays import AnyArray, Array, frozen
from mfopt.errors import InvalidDesign, SimulationError
from mfopt.records.outcome import Outcome, Status

# Spheres times steps moved, per all spheres times the steps of the cycle: a run ends after the
# cycle, and grains that have left cost nothing. 1.0 to 1.25 for designs that empty the cup.
WORK_SHARE = 1.1

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class DosingLevel:
    """Rice dosing simulated by `engine` with the grains and numerics of `dem`.

    The portion is settled by `filler`, the same for all engines: they start from one packing.

    Implements `mfopt.records.level.Level`. Work and CPU time of an outcome are those of the dosing
    run; what a first run spent on settling its packing is in `raw` as `settling_work` and
    `settling_cpu_s`, both 0 when the packing came from the cache.
    """

    name: str
    settings: DosingSettings
    dem: DemSettings
    engine: Engine
    cache: Path | None = None  # directory of settled packings; None for the user's cache
    snapshots: int = 0  # number of moments at which all grains are stored
    filler: Engine = field(default_factory=NumbaEngine)

    def work(self, x: Array) -> float:
        """Predict the work of a run: spheres times steps of a cycle; the same for every `x`."""
        order = packing_order(self.settings, self.dem, seed=0)
        timestep = self.engine.timestep(
            order.grain, order.grain_material, order.wall_material, order.physics
        )
        steps = MILLI * self.settings.cycle_ms / timestep
        spheres = self.dem.grains * self.dem.spheres_per_grain
        return WORK_SHARE * spheres * steps * self.engine.cost_factor

    def evaluate(self, x: Array, *, seed: int) -> Outcome:
        """Run once at `x` (d,) [mm, -] from the packing of that seed."""
        try:
            machine, setup, settled = self._start(x, seed)
        except InvalidDesign as error:
            return self._failed(x, seed, "invalid_design", str(error))
        except SimulationError as error:
            return self._failed(x, seed, "crashed", str(error))
        movement = self.engine.move(setup, time_limit_s=self.dem.time_limit_s)
        return self._outcome(x, seed, machine, setup, settled, movement)

    def probe(self, x: Array, *, seed: int, share: float) -> Outcome:
        """Run the first `share` of the cycle at `x` (d,): whether it runs, and how fast."""
        try:
            _, setup, _ = self._start(x, seed)
        except InvalidDesign as error:
            return self._failed(x, seed, "invalid_design", str(error))
        except SimulationError as error:
            return self._failed(x, seed, "crashed", str(error))
        part = share * MILLI * self.settings.cycle_ms
        short = replace(setup, duration=part, snapshot_times=np.empty(0))
        movement = self.engine.move(short, time_limit_s=self.dem.time_limit_s)
        work = movement.sphere_steps * self.engine.cost_factor
        why = movement.why
        return Outcome(frozen(x), self.name, seed, movement.status, why, {}, work, movement.cpu_s)

    def _start(self, x: Array, seed: int) -> tuple[Design, Setup, Settled]:
        """The machine, the run as an engine is given it, and the packing that it starts from.

        Raises:
            InvalidDesign: if the machine cannot be built.
            SimulationError: if the grains cannot be settled.
        """
        machine = design(self.settings, x)
        order = packing_order(self.settings, self.dem, seed)
        cache = default_cache() if self.cache is None else self.cache
        limit = self.dem.time_limit_s
        settled = settled_packing(self.filler, order, cache, time_limit_s=limit)
        setup = dosing_setup(self.settings, machine, order, settled.packing, self.snapshots)
        return machine, setup, settled

    def _outcome(
        self,
        x: Array,
        seed: int,
        machine: Design,
        setup: Setup,
        settled: Settled,
        movement: Movement,
    ) -> Outcome:
        status, why, raw = movement.status, movement.why, _no_results()
        if status == "finished":
            count = tally(machine, setup, movement)
            raw = raw_results(setup, movement, count, seed)
            raw["settling_cpu_s"] = np.asarray(settled.cpu_s)
            raw["settling_work"] = np.asarray(settled.work)
            if count.lost:
                status = "crashed"
                why = (
                    f"{count.lost} of {self.dem.grains} grains were lost, the first at "
                    f"{count.first_lost}; use a shorter time step or stiffer grains"
                )
        work = movement.sphere_steps * self.engine.cost_factor
        return Outcome(frozen(x), self.name, seed, status, why, raw, work, movement.cpu_s)

    def _failed(self, x: Array, seed: int, status: Status, why: str) -> Outcome:
        return Outcome(frozen(x), self.name, seed, status, why)


def _no_results() -> dict[str, AnyArray]:
    return {}
