"""The dosing scene without grains: flow through the opening, flight, and the hopper's capacity.

1. Cup. Each of a row of columns along the cup sinks while the hole is beneath it, at first in
   free fall, then at the speed of Beverloo's law with the opening's hydraulic diameter D,
   u_o = C_o sqrt(g (D - k d)), so u = u_o tanh(g tau / u_o) after tau seconds over the hole.
2. Flight. What leaves is followed down to the neck with the cup's horizontal velocity. On a
   wall it loses its normal velocity, and friction mu takes mu times as much of the tangential
   one (Coulomb): impact and sliding alike.
3. Neck. The place of the hopper with the smallest capacity lets through at most
   Q = C_n A sqrt(g (D - k d)) of bulk volume; more waits in a queue. Below it all fall freely.

Source: Beverloo, Leniger and van de Velde, Chemical Engineering Science 15 (1961) 260,
W = C rho sqrt(g) (D - k d)^(5/2), doi.org/10.1016/0009-2509(61)85030-6, with the area of a
circle replaced by that of the opening.
"""

import math
import time
from dataclasses import dataclass

import numpy as np

from fidelity.dosing import MICRO, MILLI, Design, design
from fidelity.dosing_run import GRAVITY
from fidelity.settings import DosingSettings
from mfopt.arrays import AnyArray, Array, IntArray, frozen
from mfopt.errors import InvalidDesign
from mfopt.outcome import Outcome

TIME_STEP = 4e-3  # [s] of the discharge
COLUMNS = 24  # along the cup
HEIGHTS = 24  # steps of the flight from the plate to the tube
SLOWEST = 0.02  # [m/s] what slides slower than this stays in the hopper
GOLDEN = (math.sqrt(5) - 1) / 2  # spreads parcels evenly across the cup
WORK = 2e4  # [sphere-steps] of YADE that take as long as one evaluation, about 5 ms


@dataclass(frozen=True, slots=True)
class Flow:
    """The model's few constants [1]."""

    opening: float = 0.5  # C_o
    neck: float = 0.74  # C_n
    beverloo_k: float = 1.4  # grains at the rim that do not count; 1.4-1.5 for round grains
    slip: float = 1.0  # share of the cup's velocity that the stream takes along


@dataclass(frozen=True, slots=True, eq=False)
class _Stream:
    """Parcels of bulk on their way down, (p,) each."""

    share: Array  # of the portion
    time: Array  # [s]
    x: Array  # [m]
    y: Array  # [m]
    vx: Array  # [m/s]
    vy: Array  # [m/s]
    vz: Array  # [m/s] downwards


@dataclass(frozen=True, slots=True)
class ReducedDosing:
    """Rice dosing in milliseconds; deterministic, the seed changes nothing.

    Implements `mfopt.level.Level`.
    """

    name: str
    settings: DosingSettings
    grains: int = 1000  # passage times are the quantiles for so many grains of that size
    flow: Flow = Flow()

    def work(self, x: Array) -> float:
        """Work of an evaluation, the same for every `x` [sphere-steps]."""
        return WORK

    def evaluate(self, x: Array, *, seed: int) -> Outcome:
        """Estimate the outcome at `x` (d,) [mm, -]."""
        start = time.process_time()
        try:
            machine = design(self.settings, x)
        except InvalidDesign as error:
            return Outcome(frozen(x), self.name, seed, "invalid_design", str(error))
        raw = self._raw(machine)
        cpu_s = time.process_time() - start
        return Outcome(frozen(x), self.name, seed, "finished", None, raw, WORK, cpu_s)

    def _raw(self, machine: Design) -> dict[str, AnyArray]:
        duration = MILLI * self.settings.duration_ms
        stream, left = discharge(machine, self.flow, self.grain_diameter, duration)
        times = passage(machine, self.flow, self.grain_diameter, stream)
        passed_times = quantiles(times, stream.share, self.grains, duration)
        left_in_cup = round(left * self.grains)
        passed = min(len(passed_times), self.grains - left_in_cup)
        values = {
            "passage_times": frozen(passed_times[:passed]),
            "grains": self.grains,
            "passed": passed,
            "left_in_cup": left_in_cup,
            "left_in_hopper": self.grains - left_in_cup - passed,
            "lost": 0,
            "duration": duration,
            "end_time": float(passed_times[passed - 1]) if passed else duration,
        }
        return {name: np.asarray(value) for name, value in values.items()}

    @property
    def grain_diameter(self) -> float:
        """Diameter of the sphere with a grain's volume [m]."""
        volume = self.settings.portion_kg / self.settings.grain.density_kg_m3 / self.grains
        return float((6 * volume / math.pi) ** (1 / 3))
