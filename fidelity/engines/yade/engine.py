"""YADE, the reference grain engine: a process per run, with the system's Python."""

import math
import shutil
import subprocess
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Literal

from fidelity.engine import Grain, Material, Movement, Physics, Setup, sizes
from fidelity.engines.elsewhere import move_elsewhere
from fidelity.engines.refuse import refusal, refuse
from fidelity.programs.process import Ended
from mfopt.errors import ConfigError

Precision = Literal["double", "longdouble", "float128"]

PROGRAMS: dict[Precision, str] = {
    "double": "yade",
    "longdouble": "yade-longdouble",
    "float128": "yade-float128",
}
# Cost of a sphere-step relative to double precision, measured with Debian's yade 2023.02a.
COST_FACTORS: dict[Precision, float] = {"double": 1.0, "longdouble": 5.0, "float128": 32.0}

# Usual `Physics.timestep_factor`. At 1.3 a discharge of damped grains with a restitution of 0.32
# was 23 % slower than at 0.6; with a restitution above 0.4 both agreed.
USUAL_STEP = 0.6
TRACE_PERIOD_S = 0.01  # simulated time between two files of a trace

HAS = (  # of `Physics`
    "contact_law", "restitution", "damping", "damp_gravity", "gravity", "gravity_direction",
    "timestep_factor", "adhesion_energy", "linear_drag", "quadratic_drag",
)  # fmt: skip
DRAGS = ("linear_drag", "quadratic_drag")  # act on spheres, so on grains of one sphere only

_SCRIPT = Path(__file__).with_name("script.py")

# YADE's start script opens two ports to the whole network, one of them a Python console, before it
# runs ours. It first imports the module that its option -L names, from the run's directory.
# There, too, goes the folder in /tmp that every YADE makes, and that it leaves when it is done.
_FIRST = "mfopt_first"
_FIRST_SOURCE = """
import os
import yade.remote

yade.remote.runServers = lambda: None
os.rmdir(os.path.dirname(yade.O.tmpFilename()))
"""


@dataclass(frozen=True, slots=True)
class YadeEngine:
    """Discrete elements by YADE (doi:10.5281/zenodo.5705394), one thread a run.

    Runs repeat bit for bit. The contact law "linear" has neither restitution nor adhesion here,
    "hertz" needs a restitution. On walls YADE takes R* = 2/3 R: adhesion there is 2/3 of `numba`'s.
    """

    precision: Precision = "double"
    # Directory for VTK files of the run. Changes no result, hence not part of the identity.
    trace: Path | None = field(default=None, repr=False, compare=False)

    @property
    def name(self) -> str:
        """`yade`, or the program of another precision."""
        return PROGRAMS[self.precision]

    @property
    def cost_factor(self) -> float:
        """Cost of one sphere-step relative to double precision."""
        return COST_FACTORS[self.precision]

    def version(self) -> str:
        """Version of YADE.

        Raises:
            ConfigError: if it is not installed.
        """
        return _version(PROGRAMS[self.precision])

    def timestep(
        self, grain: Grain, grain_material: Material, wall_material: Material, physics: Physics
    ) -> float:
        """Time step [s]: a part of r_min sqrt(density / E) of the grain.

        Measured with grains of 5 spheres: in a box as soft as they are, 3 is stable and 4 is not;
        with steel walls, and a grain between a rim and an edge, 1.2 was and 1.8 was not always.
        """
        wave = math.sqrt(grain_material.density / grain_material.young_modulus)
        factor = USUAL_STEP if physics.timestep_factor is None else physics.timestep_factor
        return factor * float(grain.radii.min()) * wave

    def move(self, setup: Setup, *, time_limit_s: float) -> Movement:
        """Move the grains in a YADE of their own, with the time step of the smallest grain.

        Raises:
            ConfigError: if YADE is not installed, or lacks physics that the setup asks for.
        """
        _check(self.name, setup)
        _version(PROGRAMS[self.precision])
        settings = {"timestep": self._smallest_timestep(setup), **_trace_settings(self.trace)}
        return move_elsewhere(setup, settings, self._command, _died, time_limit_s=time_limit_s)

    def _command(self, directory: Path) -> list[str]:
        """What runs YADE in `directory`, into which it writes the module imported first."""
        (directory / f"{_FIRST}.py").write_text(_FIRST_SOURCE, encoding="utf-8")
        options = ["-n", "-x", "-j1", "-L", _FIRST]
        return [PROGRAMS[self.precision], *options, str(_SCRIPT), str(directory)]

    def _smallest_timestep(self, setup: Setup) -> float:
        wall_material = setup.walls[0].material if setup.walls else setup.grain_material
        whole = self.timestep(setup.grain, setup.grain_material, wall_material, setup.physics)
        return whole * float(sizes(setup.packing).min())


def _check(engine: str, setup: Setup) -> None:
    physics = setup.physics
    refuse(engine, physics, has=HAS)
    for name in DRAGS:
        if getattr(physics, name) != 0.0 and len(setup.grain.radii) > 1:
            remedy = "set it to 0.0, give the grains one sphere"
            raise refusal(engine, name, getattr(physics, name), remedy)
    if physics.contact_law == "linear" and physics.restitution is not None:
        remedy = 'set it to None, or contact_law = "hertz"'
        raise refusal(engine, "restitution", physics.restitution, remedy)
    if physics.contact_law == "linear" and physics.adhesion_energy != 0.0:
        remedy = 'set it to 0.0, or contact_law = "hertz"'
        raise refusal(engine, "adhesion_energy", physics.adhesion_energy, remedy)
    if physics.contact_law == "hertz" and physics.restitution is None:
        remedy = 'with contact_law = "hertz" give a value'
        raise refusal(engine, "restitution", None, remedy)


def _died(ended: Ended) -> str:
    how = "ended with" if (ended.returncode or 0) >= 0 else "was killed twice, by signal"
    return f"YADE {how} {abs(ended.returncode or 0)}"


def _trace_settings(trace: Path | None) -> dict[str, str | float]:
    if trace is None:
        return {}
    trace.mkdir(parents=True, exist_ok=True)
    return {"trace": f"{trace.resolve()}/", "trace_period": TRACE_PERIOD_S}


@cache
def _version(program: str) -> str:
    if shutil.which(program) is None:
        raise ConfigError(
            f"{program} is not installed; install it (Debian, Ubuntu: apt-get install yade), "
            "or choose the engine bullet"
        )
    command = [program, "--version"]
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    if answer.returncode < 0:  # a signal killed it: once more, as with runs
        answer = subprocess.run(command, capture_output=True, text=True, check=False)
    words = answer.stdout.split()
    if answer.returncode != 0 or not words:
        raise ConfigError(f"{program} --version fails: {answer.stderr.strip()[-200:]}")
    return words[-1]
