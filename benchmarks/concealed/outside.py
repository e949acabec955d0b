"""Physics that the library of a diagnosis lacks, for recordings made by YADE.

A bar across the box is a setting of the scene; soft lips of the outlet are walls that are added.
The rest acts in YADE's own loop (`yade_script.py`): wind in a zone, grains stuck in the corners, a
leak, friction that falls with sliding. There, too, acts rolling resistance, which the library has
but the engine `yade` of mfopt does not.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from fidelity.engine import Movement, Setup, Wall
from fidelity.engines.yade.engine import YadeEngine
from mfopt.arrays import Array, IntArray

SCRIPT = Path(__file__).with_name("yade_script.py")
SETTINGS = "outside.json"  # in the directory of a run

OBSTACLE, LIPS = "obstacle", "soft lips"
IN_LOOP = ("side wind in a zone", "grains stuck in corners", "leak", "friction falls with sliding")
OUTSIDE = (OBSTACLE, LIPS, *IN_LOOP)
BAR_MM, BAR_HEIGHT_MM = 24.0, 30.0  # diameter at full strength, and where it is
SOFTER, LIP = 40.0, 0.004  # [-] than the grains at full strength, [m]
FLAT = 1e-9  # [m]


@dataclass(frozen=True, slots=True)
class AlteredYade(YadeEngine):
    """YADE with physics that mfopt does not have."""

    outside: str = ""  # one of `OUTSIDE`, or nothing
    share: float = 0.0  # of its full strength
    rolling: float = 0.0  # coefficient of rolling resistance

    def move(self, setup: Setup, *, time_limit_s: float) -> Movement:
        """Move the grains; while the vessel is filled nothing is altered."""
        if self.outside == LIPS and not setup.settle:
            setup = _soft_lips(setup, self.share)
        return YadeEngine.move(self, setup, time_limit_s=time_limit_s)

    def _command(self, directory: Path) -> list[str]:
        command = YadeEngine._command(self, directory)
        acts = {name: self.share if self.outside == name else 0.0 for name in IN_LOOP}
        (directory / SETTINGS).write_text(json.dumps({**acts, "rolling": self.rolling}))
        return [*command[:-2], str(SCRIPT), command[-1]]


def conditions_with(outside: str, share: float) -> Mapping[str, float]:
    """What an effect changes in the conditions of a recording."""
    if outside != OBSTACLE:
        return {}
    return {"bar_mm": share * BAR_MM, "bar_height_mm": BAR_HEIGHT_MM}


def _soft_lips(setup: Setup, share: float) -> Setup:
    """Lips of the outlet that are softer than the grains: bars on the outlet's edges."""
    hopper = setup.walls[0]
    x, z = hopper.vertices[:, 0], hopper.vertices[:, 2]
    edge = float(np.abs(x[np.isclose(z, z.min())]).max())
    # The top of the edge: where a flat floor begins, at the outlet itself on a wedge.
    top = float(z[np.isclose(np.abs(x), edge, atol=FLAT)].max())
    soft = replace(hopper.material, young_modulus=hopper.material.young_modulus / SOFTER**share)
    lips = [
        Wall(
            f"lip {number}", *_box((x0, 0.0, top + 0.1 * LIP), (LIP, _depth(setup), LIP)), soft,
            friction_angle=hopper.friction_angle,
        )
        for number, x0 in enumerate((-edge - LIP / 2.0, edge + LIP / 2.0))
    ]  # fmt: skip
    return replace(setup, walls=(*setup.walls, *lips))


def _box(
    middle: tuple[float, float, float], size: tuple[float, float, float]
) -> tuple[Array, IntArray]:
    """Vertices (8, 3) [m] and triangles (12, 3) of a box."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    vertices = np.array(middle) + signs * np.array(size) / 2.0
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))]
    return vertices, np.array(triangles, dtype=np.int64)


def _depth(setup: Setup) -> float:
    """Depth of the box [m]."""
    return float(np.ptp(setup.walls[0].vertices[:, 1]))
