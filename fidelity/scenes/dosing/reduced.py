"""The dosing scene without grains: flow through the opening, flight, and the hopper's capacity.

1. Cup. Each of a row of columns along the cup sinks while the hole is beneath it, at first in
   free fall, then at the speed of Beverloo's law with the full opening's hydraulic diameter D:
   du/dt = g (1 - (u / u_o)^2), u_o = C_o sqrt(g (D - k d)). Columns beside the opening slide
   into it as far as they stand above the slope of repose.
2. Flight. What leaves is followed down to the neck with a share of the cup's velocity. On a
   wall it loses its normal velocity, and friction mu takes mu times as much of the tangential
   one (Coulomb): impact and sliding alike.
3. Neck. The place of the hopper with the smallest capacity lets a stream through at most at
   C_s A sqrt(g D) of bulk volume per time; what exceeds that queues up, and a queue only leaves
   at C_q A sqrt(g (D - k d)). Below the neck all fall freely.

Source: Beverloo, Leniger and van de Velde, Chemical Engineering Science 15 (1961) 260,
W = C rho sqrt(g) (D - k d)^(5/2), doi.org/10.1016/0009-2509(61)85030-6, with the area of a
circle replaced by that of the opening.
"""

import math
import time
from dataclasses import dataclass

import numpy as np

from fidelity.grains.settings import GRAVITY, MILLI
from fidelity.scenes.dosing.design import Design, design
from fidelity.scenes.dosing.settings import DosingSettings
from mfopt.arrays import AnyArray, Array, frozen
from mfopt.errors import InvalidDesign
from mfopt.records.outcome import Outcome

TIME_STEP = 5e-3  # [s] of the discharge
COLUMNS = 16  # along the cup
HEIGHTS = 20  # steps of the flight from the plate to the tube
BEVERLOO_K = 1.4  # grains along the rim that do not count; 1.4-1.5 for round, to 2.5 for long
SLOWEST = 0.02  # [m/s] what slides slower than this stays in the hopper
GOLDEN = (math.sqrt(5) - 1) / 2  # spreads parcels evenly across the cup
QUEUE = 0.02  # [s] of waiting that makes a queue: a layer of grains at 1 m/s
WORK = 3e4  # [sphere-steps] of YADE that take as long as one evaluation, about 8 ms


@dataclass(frozen=True, slots=True)
class Flow:
    """The model's constants [1].

    Chosen on 14 designs run in YADE with 300 grains, for the rank correlation of the spread
    and of the grains left in the cup. On 13 other designs the rank correlation is 0.5 for the
    standard deviation of the passage times, 0.6 for their span, 0.9 for the grains left in the
    cup and 0.7 for the objective; the share left in the cup is off by 0.09. Beverloo's
    C = 0.58 would make `opening` and `queue` 4 C / pi = 0.74.
    """

    opening: float = 0.34  # C_o
    queue: float = 0.83  # C_q
    stream: float = 0.84  # C_s
    slip: float = 0.41  # share of the cup's velocity that the stream takes along
    repose: float = 1.72  # slope (tangent) at which the bed beside the opening stays
    drop: float = 0.5  # fall in grain diameters before a column lets grains go


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

    Implements `mfopt.records.level.Level`.
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
        friction = math.tan(_angle_on_walls(self.settings))
        times = passage(machine, self.flow, self.grain_diameter, stream, friction)
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


def _angle_on_walls(settings: DosingSettings) -> float:
    """Friction angle of grains on walls [rad], as in the discrete elements."""
    if settings.wall_friction_angle is not None:
        return settings.wall_friction_angle
    return math.radians(min(settings.wall.friction_angle_deg, settings.grain.friction_angle_deg))


def discharge(machine: Design, flow: Flow, grain: float, duration: float) -> tuple[_Stream, float]:
    """What leaves the cup when and where, and the share of the portion that stays in it.

    Args:
        machine: the design.
        flow: the model's constants.
        grain: diameter of the grain [m].
        duration: of the run [s].
    """
    cup, hole = machine.cup.section, machine.hole
    times = np.arange(0.0, duration, TIME_STEP)
    pitch = cup.length / COLUMNS
    columns = (np.arange(COLUMNS) + 0.5) * pitch - cup.length / 2
    position = machine.cup_position(times)
    place = position[:, None] + columns - hole.shift  # (t, c) from the hole's middle
    beside = np.maximum(np.abs(place) - hole.length / 2, 0.0)  # distance from the opening
    width, length = min(cup.width, hole.width), min(cup.length, hole.length)
    diameter = 2 * length * width / (length + width)
    limit = flow.opening * math.sqrt(GRAVITY * max(diameter - BEVERLOO_K * grain, 1e-9))
    # An opening is one only if the hole is beneath the cup itself.
    is_open = np.any(beside <= 0, axis=1)
    floors = np.where(is_open[:, None], np.minimum(flow.repose * beside, machine.cup.height), 1e9)
    heights, speeds = _sinking(
        floors, machine.cup.height, limit, width / cup.width, flow.drop * grain
    )
    share = -np.diff(heights, axis=0) / (machine.cup.height * COLUMNS)
    k, c = np.nonzero(share > 0)
    velocity = machine.cup_velocity(times) * (times < machine.cycle)
    across = (np.mod(GOLDEN * (k * COLUMNS + c), 1.0) - 0.5) * width
    edge = hole.length / 2
    x = hole.shift + np.clip(place[k, c], -edge, edge)
    zero = np.zeros(len(k))
    stream = _Stream(share[k, c], times[k], x, across, flow.slip * velocity[k], zero, speeds[k, c])
    return stream, float(heights[-1].mean() / machine.cup.height)


def _sinking(
    floors: Array, height: float, limit: float, part: float, drop: float
) -> tuple[Array, Array]:
    """Heights (t + 1, c) [m] and speeds (t, c) [m/s] of columns that sink down to their floors.

    Args:
        floors: height above which a column flows, per time and column (t, c) [m].
        height: of every column at the start [m].
        limit: speed u_o at which it sinks in the end [m/s].
        part: of the width that is open; the columns sink as much slower.
        drop: fall that a column needs before it sinks, each time that it starts [m].
    """
    heights = np.full((len(floors) + 1, floors.shape[1]), height)
    speeds = np.zeros(floors.shape)
    speed, fallen, level = np.zeros(floors.shape[1]), np.zeros(floors.shape[1]), heights[0]
    moving = floors.min(axis=1) < height
    for step, floor in enumerate(floors):
        if moving[step]:
            speed += TIME_STEP * GRAVITY * (1 - (speed / limit) ** 2)
            np.minimum(speed, limit, out=speed)
            flows = floor < level
            speed *= flows
            fallen = (fallen + TIME_STEP * speed) * flows
            sunk = part * TIME_STEP * speed * (fallen > drop)
            level = np.where(flows, np.maximum(level - sunk, floor), level)
            speeds[step] = speed
        else:
            speed[:], fallen[:] = 0.0, 0.0
        heights[step + 1] = level
    return heights, speeds


def passage(machine: Design, flow: Flow, grain: float, stream: _Stream, friction: float) -> Array:
    """Times (p,) at which the parcels pass the tube's end [s].

    Args:
        machine: the design.
        flow: the model's constants.
        grain: diameter of the grain [m].
        stream: what left the cup.
        friction: coefficient of friction of the walls.
    """
    z = np.linspace(0.0, machine.loft.heights[-1], HEIGHTS + 1)
    values = machine.loft.values(z)
    length, width, radius = values[:, 0], values[:, 1], values[:, 2]
    area = length * width - (4 - math.pi) * radius**2
    perimeter = 2 * (length + width) - (8 - 2 * math.pi) * radius
    diameter = 4 * area / perimeter
    neck = int(np.argmin(area * np.sqrt(diameter)))
    free = flow.stream * math.sqrt(GRAVITY * diameter[neck])
    slow = flow.queue * math.sqrt(GRAVITY * max(diameter[neck] - BEVERLOO_K * grain, 1e-9))
    arrival, speed = _flight(stream, z[: neck + 1], values[: neck + 1], friction)
    order = np.argsort(arrival, kind="stable")
    lengths = stream.share[order] * machine.cup.volume / area[neck]  # [m] of the neck's prism
    leaves = np.empty_like(arrival)
    leaves[order] = queue(arrival[order], lengths / free, lengths / slow)
    waited = leaves - arrival > TIME_STEP
    start = np.where(waited, np.minimum(speed, slow), speed)
    fall = z[neck] - machine.tube_end_z
    return np.asarray(leaves + (np.sqrt(start**2 + 2 * GRAVITY * fall) - start) / GRAVITY)


def queue(arrival: Array, free: Array, slow: Array) -> Array:
    """Departure times of sorted arrivals that are served one after the other [s].

    Args:
        arrival: sorted times (p,) [s].
        free: time that each takes if there is no queue (p,) [s].
        slow: time that each takes out of a queue (p,) [s].
    """
    leaves, last = [], -math.inf
    for at, swift, tough in zip(arrival.tolist(), free.tolist(), slow.tolist(), strict=True):
        last = last + tough if last - at > QUEUE else max(last, at) + swift
        leaves.append(last)
    return np.array(leaves)


def _flight(stream: _Stream, z: Array, values: Array, friction: float) -> tuple[Array, Array]:
    """Arrival time [s] and downward speed [m/s] of every parcel at the last of the heights `z`."""
    t, x, y = stream.time.copy(), stream.x.copy(), stream.y.copy()
    vx, vy, vz = stream.vx.copy(), stream.vy.copy(), stream.vz.copy()
    half = values[:, :2] / 2
    for i in range(1, len(z)):
        drop = z[i - 1] - z[i]
        faster = np.sqrt(vz**2 + 2 * GRAVITY * drop)
        dt = 2 * drop / (vz + faster)
        t += dt
        x += vx * dt
        y += vy * dt
        vz = faster
        for sign in (1.0, -1.0):
            wall, above = (
                half[i] + [sign * values[i, 3], 0],
                half[i - 1] + [sign * values[i - 1, 3], 0],
            )
            slope = (wall - above) / drop
            _at_wall(x, vx, vz, sign, wall[0], slope[0], friction)
            _at_wall(y, vy, vz, sign, wall[1], slope[1], friction)
    return t, vz


def _at_wall(
    q: Array, vq: Array, vz: Array, sign: float, wall: float, slope: float, friction: float
) -> None:
    """Stop, in place, parcels that are beyond a wall on the side of positive `sign` * q.

    `slope` = d(sign q)/d(depth) of the wall; its tangent, downwards, is (slope, 1) / n and the
    normal into it (1, -slope) / n.
    """
    hit = np.flatnonzero(sign * q > wall)
    if not hit.size:
        return
    n = math.hypot(1.0, slope)
    outward, down = sign * vq[hit], vz[hit]
    into = np.maximum((outward - slope * down) / n, 0.0)
    along = np.maximum((slope * outward + down) / n - friction * into, SLOWEST)
    q[hit] = sign * wall
    vq[hit] = sign * along * slope / n
    vz[hit] = along / n


def quantiles(times: Array, share: Array, grains: int, duration: float) -> Array:
    """Passage times of single grains (n,) [s] out of `grains`, from parcels' times and shares."""
    order = np.argsort(times, kind="stable")
    kept = order[times[order] <= duration]
    passed = np.cumsum(share[kept]) * grains
    count = round(float(passed[-1])) if len(kept) else 0
    if count == 0:
        return np.empty(0)
    return np.asarray(np.interp(np.arange(count) + 0.5, passed, times[kept]))
