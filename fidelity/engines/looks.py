"""What an engine keeps of its looks at the grains, and when that ends a run.

YADE and Bullet look at their grains in Python, every now and then, in processes of their own. This
file needs only numpy: YADE runs it in a Python of its own.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fidelity.engine import SETTLED_S, Movement, Setup, sizes
from fidelity.samples import Sampling, begin, look, series
from mfopt.arrays import Array

Spheres = Callable[[], Array]  # centres and radii (m, 4) [m] of the spheres of grains still there


@dataclass
class Seen:
    """What the looks saw so far; grown look by look."""

    there: list[int]  # numbers of the grains that have not left
    exit_times: Array  # (n,) [s]
    positions: Array  # (n, 3) [m] at the last look that kept them; where it left, if it did
    orientations: Array  # (n, 4)
    velocities: Array  # (n, 3) [m/s]
    angular_velocities: Array  # (n, 3) [rad/s]
    due: list[float]  # [s] snapshots to come
    sampling: Sampling | None = None
    snapshots: dict[str, list[Any]] = field(default_factory=dict)
    sphere_steps: float = 0.0
    max_overlap: float = 0.0  # [smallest radius]
    max_kinetic_energy: float = 0.0  # [J]
    quiet_since: float | None = None  # [s] the grains are at rest since then
    why: str | None = None  # the run is broken, and why


def first_look(setup: Setup) -> Seen:
    """Before the first step: all grains are where the setup puts them."""
    n = len(setup.packing.positions)
    return Seen(
        there=list(range(n)),
        exit_times=np.full(n, np.nan),
        positions=setup.packing.positions.copy(),
        orientations=setup.packing.orientations.copy(),
        velocities=np.zeros((n, 3)),
        angular_velocities=np.zeros((n, 3)),
        due=sorted(setup.snapshot_times.tolist()),
    )


def begin_samples(setup: Setup, seen: Seen, spheres: Spheres) -> None:
    """Begin to reduce what the setup asks for, if it does."""
    if setup.samples is not None:
        seen.sampling = begin(setup.samples, setup.packing.positions, spheres)


def sample(seen: Seen, now: float, places: Callable[[], Array], spheres: Spheres) -> None:
    """Reduce what is asked for at a look; `places` gives the mass centres (n, 3) [m]."""
    if seen.sampling is not None and seen.why is None:
        look(seen.sampling, now, places(), spheres)


def take_snapshots(
    seen: Seen, now: float, keep: Callable[[], object], **more: Callable[[], Array]
) -> None:
    """Take the snapshots that are due: at the first look after their time.

    Args:
        seen: is grown.
        now: [s].
        keep: brings places and velocities in `seen` up to date.
        more: what else a snapshot holds, by its name without `snapshot_`.
    """
    if not seen.due or now < seen.due[0]:
        return
    keep()
    gone = np.ones(len(seen.exit_times), dtype=bool)
    gone[seen.there] = False
    state = {
        "snapshot_times": np.asarray(now),
        "snapshot_positions": np.where(gone[:, None], np.nan, seen.positions),
        "snapshot_orientations": np.where(gone[:, None], np.nan, seen.orientations),
        "snapshot_speeds": np.where(gone, np.nan, np.linalg.norm(seen.velocities, axis=1)),
        **{f"snapshot_{name}": value() for name, value in more.items()},
    }
    while seen.due and now >= seen.due[0]:
        seen.due.pop(0)
        for name, value in state.items():
            seen.snapshots.setdefault(name, []).append(value)


def ends_early(setup: Setup, seen: Seen, now: float, heights: Array) -> bool:
    """Whether the grains are at rest, or none can still pass.

    Args:
        now: [s].
        heights: (m,) [m] of the grains still there.
    """
    if setup.settle and seen.quiet_since is not None and now - seen.quiet_since >= SETTLED_S:
        return True
    return now >= setup.idle_after and not np.any(heights < setup.idle_above_z)


def movement(
    setup: Setup, seen: Seen, spheres: Spheres, *, end_time: float, steps: int, timestep: float
) -> Movement:
    """What became of the grains; the parent measures the CPU time."""
    finished = seen.why is None
    sampled: Mapping[str, Array] = {}
    if seen.sampling is not None:
        masses = setup.grain.mass * sizes(setup.packing) ** 3
        sampled = series(seen.sampling, masses, spheres, finished=finished)
    return Movement(
        status="finished" if finished else "crashed",
        why=seen.why,
        exit_times=seen.exit_times,
        positions=seen.positions,
        orientations=seen.orientations,
        velocities=seen.velocities,
        angular_velocities=seen.angular_velocities,
        end_time=end_time,
        steps=steps,
        sphere_steps=seen.sphere_steps,
        timestep=timestep,
        max_overlap=seen.max_overlap,
        max_kinetic_energy=seen.max_kinetic_energy,
        cpu_s=0.0,
        snapshots={name: np.array(values) for name, values in seen.snapshots.items()},
        series=sampled,
    )
