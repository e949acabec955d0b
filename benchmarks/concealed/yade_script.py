"""Moves the grains inside YADE with physics that mfopt does not have.

Run in YADE's own Python in place of `fidelity.engines.yade.script`, which does the work.
`outside.json` in the directory of the run says what is added, as shares of the full strengths
below.
"""

import builtins
import json
import math
import os
import sys
from pathlib import Path
from typing import Any

from yade import O
from yade.minieigenHP import Vector3
from yade.wrapper import (
    Ip2_FrictMat_FrictMat_MindlinPhys,
    Law2_ScGeom_MindlinPhys_Mindlin,
    PyRunner,
)

sys.path.append(str(Path(sys.argv[0]).resolve().parents[2]))
from fidelity.engine import Setup
from fidelity.engines.yade import script
from fidelity.engines.yade.world import Wall
from fidelity.engines.yade.world import engines as own_engines

EVERY_S = 1e-3  # simulated time between two looks
WIND = 3.0  # [m/s2]
ZONE = (0.0, 0.06, 0.02, 0.06)  # [m] x from, to, z from, to: where the wind blows
STUCK = math.radians(45.0)  # slope of the surface under which grains are stuck
EDGE = 0.02  # [m] from the middle, where that surface starts
LEAK = 0.010  # [m] length of the hole in the floor beside the right wall, half as deep
RIGHT = 0.06  # [m] of the right wall
BELOW = 0.02  # [m] the height where grains leave, where they meet no other
FALL = 2.0  # friction falls by 1 / (1 + FALL) at SLOW
SLOW = 0.05  # [m/s] sliding speed

ITS = json.loads((Path(sys.argv[1]) / "outside.json").read_text())
HEIGHTS: dict[str, float] = {}  # [m] of the floor beside the right wall, and where grains leave


def engines(setup: Setup, walls: list[Wall], engine: Any) -> list[Any]:
    """The engines of mfopt, and what is added; nothing while a vessel is filled."""
    made = own_engines(setup, walls, engine)
    if ITS["rolling"] > 0.0:
        roll(made, ITS["rolling"])
    if setup.settle:
        return made
    every = max(1, round(EVERY_S / O.dt))
    calls = {
        "side wind in a zone": "blow()",
        "leak": "leak()",
        "friction falls with sliding": "weaken()",
    }
    made += [PyRunner(command=c, iterPeriod=every) for name, c in calls.items() if ITS[name] > 0.0]
    if ITS["grains stuck in corners"] > 0.0:
        stick()
    HEIGHTS.update(floor=floor_of(setup), exit=setup.exit_z)
    return made


def floor_of(setup: Setup) -> float:
    """Height of the floor beside the right wall [m]."""
    hopper = setup.walls[0].vertices
    beside = hopper[abs(hopper[:, 0] - RIGHT) < 1e-9]
    return float(beside[:, 2].min())


def clumps() -> list[Any]:
    """The grains, each a clump of spheres."""
    return [body for body in O.bodies if body is not None and body.isClump]


def roll(made: list[Any], coefficient: float) -> None:
    """Switch on the rolling moment of Mindlin's contacts."""
    (loop,) = (e for e in made if type(e).__name__ == "InteractionLoop")
    for functor in loop.physDispatcher.functors:
        if isinstance(functor, Ip2_FrictMat_FrictMat_MindlinPhys):
            functor.krot, functor.eta = 1.0, coefficient
    for functor in loop.lawDispatcher.functors:
        if isinstance(functor, Law2_ScGeom_MindlinPhys_Mindlin):
            functor.includeMoment = True


def blow() -> None:
    """Push the grains in the zone aside: a force as large as `WIND` times their mass."""
    low, high, bottom, top = ZONE
    force = WIND * ITS["side wind in a zone"]
    for body in clumps():
        x, _, z = body.state.pos
        there = low < x < high and bottom < z < top
        O.forces.setPermF(body.id, Vector3(force * body.state.mass if there else 0.0, 0.0, 0.0))


def stick() -> None:
    """Hold the grains that lie in the corners where they are."""
    slope = math.tan(STUCK * ITS["grains stuck in corners"])
    for body in clumps():
        x, _, z = body.state.pos
        if z < slope * (abs(x) - EDGE):
            body.state.vel = body.state.angVel = Vector3(0.0, 0.0, 0.0)
            body.state.blockedDOFs = "xyzXYZ"


def leak() -> None:
    """Take out grains that touch the floor over the hole, one at a time, as if they had left."""
    length = LEAK * ITS["leak"]
    for body in clumps():
        x, y, z = body.state.pos
        radius = O.bodies[next(iter(body.shape.members))].shape.radius
        if (
            x > RIGHT - radius - length
            and abs(y) < length / 2.0
            and z < HEIGHTS["floor"] + 1.5 * radius
        ):
            body.state.pos = Vector3(0.0, 0.0, HEIGHTS["exit"] - BELOW)
            body.state.vel = Vector3(0.0, 0.0, -1.0)
            return


FULL: dict[tuple[int, int, int], float] = {}  # tangent of the angle of a contact at first


def weaken() -> None:
    """Let friction fall with the speed at which grains slide on each other."""
    strength = FALL * ITS["friction falls with sliding"]
    for contact in O.interactions:
        if not contact.isReal:
            continue
        key = contact.id1, contact.id2, contact.iterMadeReal
        full = FULL.setdefault(key, contact.phys.tangensOfFrictionAngle)
        first, second = O.bodies[contact.id1].state, O.bodies[contact.id2].state
        normal, apart = contact.geom.normal, first.vel - second.vel
        slide = (apart - normal * apart.dot(normal)).norm()
        contact.phys.tangensOfFrictionAngle = full / (1.0 + strength * slide / SLOW)


if __name__ == "__main__":
    vars(builtins).update(blow=blow, weaken=weaken, leak=leak)  # where YADE's runners find them
    vars(script)["engines"] = engines
    script.main(Path(sys.argv[1]))
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)
