"""PyBullet as an engine: rigid bodies and impulses, a contact model independent of the springs.

What it makes of a setup: Coulomb friction as given; stiffness does not occur, bodies are
rigid; `Physics.restitution`, or where it is not given the one that the numerical damping
stands for (`world.restitution`). A moving wall yields a little to what it pinches
(`world.MOVING_WALL_MODULUS`). Free fall is undamped. `Physics.timestep_factor` is
for contact springs and not used. A grain's spheres, mass and inertia are the setup's.
"""

import importlib.metadata
import importlib.util
import sys
from dataclasses import dataclass
from pathlib import Path

from fidelity.engine import Grain, Material, Movement, Physics, Setup
from fidelity.engines.elsewhere import move_elsewhere
from fidelity.engines.refuse import refuse, refuse_walls
from mfopt.errors import ConfigError

LAST_PYTHON = (3, 11)  # that PyBullet has a wheel for

HAS = ("restitution", "damping", "damp_gravity", "gravity", "timestep_factor")  # of `Physics`


@dataclass(frozen=True, slots=True)
class BulletEngine:
    """Bullet through its Python wheel, one process a run."""

    # Shortened where a grain would fall half its radius in a step (script.safe_timestep).
    timestep_s: float = 1e-3
    iterations: int = 10  # of the contact solver, per step

    def __post_init__(self) -> None:
        if not self.timestep_s > 0.0:
            raise ConfigError(f"timestep_s = {self.timestep_s:g} must be positive; 0.001 is usual")
        if self.iterations < 1:
            raise ConfigError(f"iterations = {self.iterations} must be at least 1; 10 is usual")

    @property
    def name(self) -> str:
        """`bullet`."""
        return "bullet"

    @property
    def cost_factor(self) -> float:
        """CPU time of a sphere-step over YADE's, in the dosing scene with 300 5-sphere grains."""
        return 5.0

    def version(self) -> str:
        """Version of PyBullet.

        Raises:
            ConfigError: if it is not installed.
        """
        if importlib.util.find_spec("pybullet") is None:
            raise ConfigError(f"engine bullet: PyBullet is missing; {remedy(sys.version_info[:2])}")
        return f"pybullet {importlib.metadata.version('pybullet')}"

    def timestep(
        self, grain: Grain, grain_material: Material, wall_material: Material, physics: Physics
    ) -> float:
        """Time step [s]: the engine's own, whatever grains and materials."""
        return self.timestep_s

    def move(self, setup: Setup, *, time_limit_s: float) -> Movement:
        """Move the grains. A run that crashes, explodes or hangs is returned as such.

        Raises:
            ConfigError: if the setup asks for physics that Bullet lacks.
        """
        refuse(self.name, setup.physics, has=HAS)
        refuse_walls(self.name, setup.walls)
        settings = {"timestep": self.timestep_s, "iterations": self.iterations}
        return move_elsewhere(
            setup, settings, _command, lambda ended: f"Bullet ended with {ended.returncode}",
            time_limit_s=time_limit_s,
        )  # fmt: skip


def _command(directory: Path) -> list[str]:
    return [sys.executable, "-m", "fidelity.engines.bullet.script", str(directory)]


def remedy(python: tuple[int, int]) -> str:
    """What to do where PyBullet is missing, in that version of Python."""
    if python <= LAST_PYTHON:
        return "run `pip install pybullet`"
    wanted, found = (".".join(map(str, version)) for version in (LAST_PYTHON, python))
    return (
        f"it has no wheel for Python {found}: use Python {wanted} or older, or another engine, "
        "such as numba"
    )
