"""Settled portions in the cup: made once, kept in a cache, and checked before every use.

A packing is found by the digest of everything that it depends on. A file that is damaged or
fails the check is made again. Of several processes that want the same packing one makes it,
the others wait.
"""

import contextlib
import fcntl
import hashlib
import json
import logging
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fidelity.engine import Engine, Grain, Material, Packing, Physics, Setup, Wall
from fidelity.grains.portion import flaw, loose_portion
from geometry.mesh import Mesh
from geometry.parts import Cup, cup_wall
from mfopt.arrays import AnyArray, frozen
from mfopt.errors import ConfigError, SimulationError
from mfopt.files.array_file import read_arrays, write_arrays
from mfopt.files.cache import cache_directory

METHOD = 2  # counted up when packings are made differently, so that old ones are not used
SETTLING_DAMPING = 0.4  # [-] numerical damping; brings the portion to rest soon
# A portion fills the cup to the rim: 1 kg in 1279 ml is 49 % solid. Grains that settle with
# their full friction stop at 38 %; with this friction 300 of them reach the 49 %, sooner.
SETTLING_FRICTION = math.radians(5)  # [rad]
LONGEST_SETTLING = 0.3  # [s] then the grains creep at a few cm/s, and are taken to be at rest
# Stiff grains need short steps. They fall as softer ones, and are then stiffened tenfold at a time:
# at once, the overlaps of the softer ones would throw them about.
SOFT = 1e6  # [Pa] Young's modulus
STIFFENING = 10.0
RELAXATION = 0.03  # [s] after each stiffening
FLOOR_MARGIN = 0.05  # [m] floor around the cup

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, eq=False)
class Order:
    """Everything that a settled packing depends on."""

    grain: Grain
    grain_material: Material
    wall_material: Material
    physics: Physics
    cup: Cup
    collar: float  # [m] height of the cup's walls while grains are in it
    chordal_error: float  # [m] of the cup's mesh
    grains: int
    seed: int


@dataclass(frozen=True, slots=True, eq=False)
class Settled:
    """A settled packing, the cup's floor at z = 0 and its centre at x = y = 0."""

    packing: Packing
    cpu_s: float = 0.0  # spent on it now; 0 if it came from the cache
    work: float = 0.0  # likewise [sphere-steps times the engine's cost factor]


def default_cache() -> Path:
    """Where settled packings are kept: in the user's cache.

    Raises:
        ConfigError: if no cache takes files.
    """
    return cache_directory() / "packings"


def settled_packing(engine: Engine, order: Order, cache: Path, *, time_limit_s: float) -> Settled:
    """Take the packing from the cache, or settle it with `engine` and keep it.

    Raises:
        SimulationError: if the grains cannot be settled; the message says what happened.
    """
    path = cache / f"{digest(engine, order)}.h5"
    kept = _read(path, order)
    if kept is not None:
        return Settled(kept)
    with _only_one(path.with_suffix(".lock")):
        kept = _read(path, order)  # another process may have made it meanwhile
        if kept is not None:
            return Settled(kept)
        made = _settle(engine, order, time_limit_s)
        try:
            write_arrays(path, _with_checksum(made.packing))
        except ConfigError as error:  # it serves this run all the same
            log.warning("a settled packing cannot be kept, and is made again: %s", error)
        return made


def digest(engine: Engine, order: Order) -> str:
    """Digest of engine, its version and the order: the packing's name in the cache."""
    program = [engine.name, repr(engine), engine.version()]  # repr: all of the engine's fields
    method = [METHOD, SETTLING_DAMPING, SETTLING_FRICTION, LONGEST_SETTLING, RELAXATION]
    what = {"method": method, "engine": program, **asdict(order)}
    text = json.dumps(what, sort_keys=True, default=_as_list)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def _as_list(value: Any) -> Any:
    return value.tolist() if isinstance(value, np.ndarray) else str(value)


def cup_mesh(order: Order) -> Mesh:
    """Walls of the cup with its collar, floor at z = 0."""
    return cup_wall(order.cup, order.chordal_error, height=order.collar)


def _settle(engine: Engine, order: Order, time_limit_s: float) -> Settled:
    loose = loose_portion(
        order.grain, order.cup.section, order.grains, order.seed, chordal_error=order.chordal_error
    )
    # The loose layers may stand higher than the collar: while they settle the walls reach as high.
    top = float(loose.positions[:, 2].max()) + 2 * float(order.grain.radii.max())
    tall = cup_wall(order.cup, order.chordal_error, height=max(order.collar, top))
    wall = _slippery(order.wall_material)
    walls = (Wall("cup", tall.vertices, tall.triangles, wall), _floor(order.cup, wall))
    packing, cpu_s, work, why = loose, 0.0, 0.0, None
    for modulus in moduli(order.grain_material.young_modulus):
        material = replace(_slippery(order.grain_material), young_modulus=modulus)
        setup = Setup(
            grain=order.grain,
            packing=packing,
            grain_material=material,
            walls=walls,
            physics=replace(order.physics, damping=SETTLING_DAMPING),
            duration=LONGEST_SETTLING if packing is loose else RELAXATION,
            exit_z=-FLOOR_MARGIN,
            settle=True,
        )
        movement = engine.move(setup, time_limit_s=time_limit_s)
        cpu_s += movement.cpu_s
        work += movement.sphere_steps * engine.cost_factor
        why = movement.why
        if movement.status != "finished":
            break
        packing = Packing(frozen(movement.positions), frozen(movement.orientations))
    why = why or _flaw(order, packing)
    if why is not None:
        raise SimulationError(f"settling the portion in the cup failed: {why}")
    log.info("settled %d grains in %.1f CPU seconds", order.grains, cpu_s)
    return Settled(packing, cpu_s, work)


def moduli(young_modulus: float) -> list[float]:
    """Young's moduli [Pa] that the grains settle with, one after the other."""
    values = [min(SOFT, young_modulus)]
    while values[-1] < young_modulus:
        values.append(min(STIFFENING * values[-1], young_modulus))
    return values


def _slippery(material: Material) -> Material:
    """The material with the friction that it settles with."""
    return replace(material, friction_angle=SETTLING_FRICTION)


def _floor(cup: Cup, material: Material) -> Wall:
    x = cup.section.length / 2 + FLOOR_MARGIN
    y = cup.section.width / 2 + FLOOR_MARGIN
    corners = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
    return Wall("floor", corners, np.array([[0, 1, 2], [0, 2, 3]]), material)


def _flaw(order: Order, packing: Packing) -> str | None:
    return flaw(order.grain, order.cup.section, order.collar, order.grains, packing)


def _with_checksum(packing: Packing) -> dict[str, AnyArray]:
    arrays = {"positions": packing.positions, "orientations": packing.orientations}
    return {**arrays, "checksum": _checksum(packing)}


def _checksum(packing: Packing) -> AnyArray:
    content = packing.positions.tobytes() + packing.orientations.tobytes()
    return np.frombuffer(hashlib.sha256(content).digest(), dtype=np.uint8)


def _read(path: Path, order: Order) -> Packing | None:
    """The packing kept at `path`, or None if there is none that can be trusted."""
    if not path.exists():
        return None
    try:
        arrays = read_arrays(path)
        packing = Packing(frozen(arrays["positions"]), frozen(arrays["orientations"]))
        whole = np.array_equal(arrays["checksum"], _checksum(packing))
        why = _flaw(order, packing) if whole else "its checksum does not fit its content"
    except (ConfigError, OSError, KeyError, ValueError) as error:
        why = str(error)
    if why is None:
        return packing
    log.warning("the packing %s is made again: %s", path, why)
    return None


@contextlib.contextmanager
def _only_one(path: Path) -> Iterator[None]:
    """Hold a lock that dies with its process; others wait. Where there are no locks, all go on."""
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            lock = stack.enter_context(open(path, "w"))
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield
