"""One run: from a setup to a movement."""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fidelity.dem import energy
from fidelity.dem import state as at
from fidelity.dem.advance import advance
from fidelity.dem.grouping import regroup
from fidelity.dem.tables import DONE, Tables, prepare, with_more_room
from fidelity.engine import MAX_OVERLAP, SETTLED_ENERGY, SETTLED_S, Movement, Setup, sizes
from fidelity.samples import Sampling, begin, look, series
from mfopt.arrays import Array

LOOK_S = 1e-3  # [s] simulated between two looks at the grains
# The time limit is checked after so many sphere-steps, about half a second, however short a step.
PIECE = 1_000_000
LOOKS_PER_GROUPING = 5  # then grains that have left are taken out, and the others sorted by place

# A run is broken when more energy has come from nowhere than this share of what was turned over
# and is held in contacts, plus a lift of all grains by a radius.
MAX_GAIN = 0.05
# A sphere that moves further in a step can fly through a wall unseen [smallest radius].
MAX_WAY = 1.0


@dataclass
class Watch:
    """What the looks at the grains saw."""

    start_energy: float = math.nan  # [J]
    quiet_since: float | None = None  # [s]
    why: str | None = None  # the run is broken, and why
    due: list[float] = field(default_factory=list)  # snapshots to come
    snapshots: dict[str, list[Any]] = field(default_factory=dict)
    sampling: Sampling | None = None


def run(setup: Setup, dt: float, time_limit_s: float) -> Movement:
    """Move the grains of `setup` in steps of `dt` [s]."""
    began, cpu = time.monotonic(), time.thread_time()
    tables = prepare(setup, dt)
    compiling = load_kernel(tables)
    began, cpu = began + compiling[0], cpu + compiling[1]
    state = tables.state
    watch = Watch(due=sorted(setup.snapshot_times.tolist()))
    if setup.samples is not None:
        watch.sampling = begin(
            setup.samples, setup.packing.positions, lambda: spheres_there(tables)
        )
    last = math.ceil(setup.duration / dt)
    spheres_moved, timed_out = 0.0, False

    def out_of_time() -> bool:
        return time.monotonic() - began > time_limit_s

    looks, per_look = 0, 1  # the first look only measures the energy at the start
    while state.counts[at.STEP] < last and state.counts[at.GRAINS] and watch.why is None:
        steps = min(per_look, last - int(state.counts[at.STEP]))
        before = int(state.counts[at.STEP])
        tables = take_steps(tables, steps, out_of_time)
        spheres_moved += float((state.counts[at.STEP] - before) * _spheres(tables))
        per_look = max(1, int(LOOK_S / dt))
        examine(setup, tables, watch)
        sample(tables, watch)  # while grains that left are still in the tables
        looks += 1
        if looks % LOOKS_PER_GROUPING == 1:
            regroup(tables)
        now = float(state.counts[at.STEP] * dt)
        take_snapshots(tables, watch, now)
        if ends_early(setup, tables, watch, now):
            break
        if out_of_time():
            timed_out = True
            watch.why = f"not ready within the time limit of {time_limit_s:g} s"
    return _movement(setup, tables, watch, spheres_moved, timed_out, time.thread_time() - cpu)


def load_kernel(tables: Tables) -> tuple[float, float]:
    """Load the kernel, or compile it where that has not been done.

    Returns:
        wall and CPU seconds that it took, which are none of the run's.
    """
    wall, cpu = time.monotonic(), time.thread_time()
    advance(tables, 0)
    return time.monotonic() - wall, time.thread_time() - cpu


def take_steps(tables: Tables, steps: int, out_of_time: Callable[[], bool]) -> Tables:
    """Take steps, fewer if the time is up.

    Returns:
        the tables, some of them longer if they were too short.
    """
    piece = max(1, PIECE // max(1, _spheres(tables)))
    while steps and tables.state.counts[at.GRAINS]:
        taken, wanted = advance(tables, min(steps, piece))
        steps -= taken
        if wanted != DONE:
            tables = with_more_room(tables, wanted)
        elif out_of_time():
            break
    return tables


def _spheres(tables: Tables) -> int:
    return int(tables.state.counts[at.GRAINS]) * len(tables.shape)


def examine(setup: Setup, tables: Tables, watch: Watch) -> None:
    """Look at energy and contacts; note what is broken, and whether the grains are at rest."""
    state, now = tables.state, float(tables.state.counts[at.STEP] * tables.dt)
    budget, kinetic = state.budget, float(state.budget[at.KINETIC])
    budget[at.LARGEST_KINETIC] = max(budget[at.LARGEST_KINETIC], kinetic)
    if math.isnan(watch.start_energy):
        watch.start_energy = energy.total(budget)
    n = int(state.counts[at.GRAINS])
    lift = setup.grain.mass * setup.physics.gravity * n * _smallest_radius(tables)
    why = _broken(setup, tables, watch.start_energy, lift)
    watch.why = why and f"{why} at {now:.4g} s; use a shorter time step or stiffer grains"
    if kinetic >= SETTLED_ENERGY * lift:
        watch.quiet_since = None
    elif watch.quiet_since is None:
        watch.quiet_since = now


def _broken(setup: Setup, tables: Tables, start_energy: float, lift: float) -> str | None:
    """What is wrong with places, contacts or the balance of energy; None if nothing is."""
    state, budget, radius = tables.state, tables.state.budget, _smallest_radius(tables)
    total = energy.total(budget)
    gain, turned = total - start_energy, energy.turnover(budget) + abs(float(budget[at.ELASTIC]))
    moving = state.bodies.kinematics[: state.counts[at.GRAINS]]
    if not math.isfinite(total) or not np.isfinite(moving).all():
        return "a position or velocity is not a number"
    crossed = int(state.counts[at.CROSSED])
    if crossed and not setup.may_pinch:
        return f"the centre of a sphere went through the wall {setup.walls[crossed - 1].name!r}"
    if gain > MAX_GAIN * turned + lift:
        return (
            f"exploded: {gain:.3g} J came from nowhere, above {MAX_GAIN:g} of the {turned:.3g} J "
            "turned over and held"
        )
    overlap = float(budget[at.OVERLAP]) / radius
    if overlap > MAX_OVERLAP:
        return f"overlap {overlap:.2f} of the smallest radius is above {MAX_OVERLAP:g}"
    way = tables.dt * float(state.drift[4]) / radius
    if way > MAX_WAY:
        return f"a sphere moves {way:.2f} of the smallest radius in a step, above {MAX_WAY:g}"
    return None


def _smallest_radius(tables: Tables) -> float:
    return float(tables.state.spheres.place[:, 3].min())


def ends_early(setup: Setup, tables: Tables, watch: Watch, now: float) -> bool:
    """Whether the grains are at rest, or none can still pass."""
    if setup.settle and watch.quiet_since is not None:
        return now - watch.quiet_since >= SETTLED_S
    if now > setup.idle_after:
        bodies, n = tables.state.bodies, int(tables.state.counts[at.GRAINS])
        z = bodies.kinematics[:n, 2][~bodies.left[:n]]
        return not (z < setup.idle_above_z).any()
    return False


def take_snapshots(tables: Tables, watch: Watch, now: float) -> None:
    """Take the snapshots that are due: at the first look after their time."""
    while watch.due and now >= watch.due[0]:
        watch.due.pop(0)
        positions, orientations, velocities, _ = _by_number(tables)
        kept = {
            "snapshot_times": now,
            "snapshot_positions": positions,
            "snapshot_orientations": orientations,
            "snapshot_speeds": np.linalg.norm(velocities, axis=1),
            "snapshot_wall_forces": tables.state.wall_force.copy(),
        }
        for name, value in kept.items():
            watch.snapshots.setdefault(name, []).append(value)


def sample(tables: Tables, watch: Watch) -> None:
    """Reduce what `Setup.samples` asks for."""
    if watch.sampling is None or watch.why is not None:
        return
    bodies, n = tables.state.bodies, int(tables.state.counts[at.GRAINS])
    places = watch.sampling.places.copy()
    places[bodies.number[:n]] = bodies.kinematics[:n, :3]
    now = float(tables.state.counts[at.STEP] * tables.dt)
    look(watch.sampling, now, places, lambda: spheres_there(tables))


def spheres_there(tables: Tables) -> Array:
    """Centres and radii (m, 4) [m] of the spheres of the grains that have not left."""
    state, n, k = tables.state, int(tables.state.counts[at.GRAINS]), len(tables.shape)
    here = np.repeat(~state.bodies.left[:n], k)
    return np.asarray(state.spheres.place[: n * k][here])


def _by_number(tables: Tables) -> tuple[Array, Array, Array, Array]:
    """Positions, orientations, velocities and spins of all grains, nan for those that left."""
    bodies, n = tables.state.bodies, int(tables.state.counts[at.GRAINS])
    here = ~bodies.left[:n]
    number = bodies.number[:n][here]
    values = np.full((len(bodies.number), 13), np.nan)
    values[number, :9] = bodies.kinematics[:n, :9][here]
    values[number, 9:] = bodies.quaternion[:n][here]
    return values[:, :3], values[:, 9:], values[:, 3:6], values[:, 6:9]


def _movement(
    setup: Setup,
    tables: Tables,
    watch: Watch,
    spheres_moved: float,
    timed_out: bool,
    cpu_s: float,
) -> Movement:
    state = tables.state
    positions, orientations, velocities, spins = _by_number(tables)
    gone = np.isfinite(state.exits.time)
    left = state.exits.state
    status = "timed_out" if timed_out else "finished" if watch.why is None else "crashed"
    return Movement(
        status=status,  # type: ignore[arg-type]
        why=watch.why,
        exit_times=state.exits.time.copy(),
        positions=np.where(gone[:, None], left[:, :3], positions),
        orientations=np.where(gone[:, None], left[:, 9:], orientations),
        velocities=np.where(gone[:, None], left[:, 3:6], velocities),
        angular_velocities=np.where(gone[:, None], left[:, 6:9], spins),
        end_time=float(state.counts[at.STEP] * tables.dt),
        steps=int(state.counts[at.STEP]),
        sphere_steps=spheres_moved,
        timestep=tables.dt,
        max_overlap=float(state.budget[at.OVERLAP]) / _smallest_radius(tables),
        max_kinetic_energy=float(state.budget[at.LARGEST_KINETIC]),
        cpu_s=cpu_s,
        snapshots={name: np.array(values) for name, values in watch.snapshots.items()},
        energy=energy.named(state.budget, watch.start_energy),
        series=_series(setup, tables, watch),
    )


def _series(setup: Setup, tables: Tables, watch: Watch) -> Mapping[str, Array]:
    if watch.sampling is None:
        return {}
    masses = setup.grain.mass * sizes(setup.packing) ** 3
    return series(watch.sampling, masses, lambda: spheres_there(tables), finished=watch.why is None)
