"""Figures of the validation: engine and closed form in one picture each."""

import math
import shutil
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.engine.small_scenes import (
    LIMIT_S,
    G,
    R,
    Start,
    finished,
    forces_at,
    mesh,
    moved,
    ridge,
    scene,
    sled,
    spheres_in_line,
    still,
    wall_stiffness,
)
from benchmarks.engine.validation_scenes import MU, end_on, lack, on_slope, piles, returned
from fidelity.engine import ContactLaw
from fidelity.engines.numba import MARGIN
from fidelity.engines.yade.engine import YadeEngine
from mfopt.arrays import Array
from reports.charts import BLUE, GREEN, GREY, ORANGE, PURPLE, WIDTH, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LAWS: tuple[tuple[ContactLaw, str], ...] = (("linear", BLUE), ("hertz", ORANGE))
OVERLAP = 0.02 * R


def draw_all(out: Path) -> None:
    """Run what the figures show, and draw them as SVG in `out`."""
    with styled():
        for draw in (restitution, edges, energy, incline, rolling, rotation):
            figure = draw()
            path = out / f"{draw.__name__}.svg"
            figure.savefig(path, format="svg", metadata={"Date": None, "Creator": None})


def _panels(count: int) -> "tuple[Figure, list[Axes]]":
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, 2.7), layout="constrained")
    return figure, list(np.atleast_1d(figure.subplots(1, count)))


def restitution() -> "Figure":
    """Restitution found less asked for: mean and range over all phases of a step."""
    figure, (sphere, clump) = _panels(2)
    asked = [round(0.1 * i, 1) for i in range(1, 11)]
    for panel, title in ((sphere, "sphere"), (clump, "end of a clump, at 60°")):
        panel.axhline(0.0, color=GREY, lw=0.8)
        for shift, (law, colour) in zip((-0.008, 0.008), LAWS, strict=True):
            found = [end_on(law, e, 60.0) if panel is clump else returned(law, e) for e in asked]
            less = [f - e for f, e in zip(found, asked, strict=True)]
            mean, low, high = np.transpose([(f.mean(), f.min(), f.max()) for f in less])
            panel.plot(np.array(asked) + shift, mean, "o", ms=3, color=colour, label=law)
            panel.vlines(np.array(asked) + shift, low, high, color=colour, lw=1)
        panel.set_title(title, fontsize=9)
        panel.set_xlabel("restitution asked for")
        panel.set_ylim(-0.05, 0.05)
    sphere.set_ylabel("found, less asked for")
    sphere.legend()
    return figure


def edges() -> "Figure":
    """Force on a sphere led over an edge, over that of one contact: over a crest, the deepest."""
    figure, (seam, valley, crest) = _panels(3)
    for panel, title, half, degrees in (
        (seam, "coplanar triangles", 0.4, (0.0,)),
        (valley, "valley", 0.12, (7.5, 15.0, 30.0)),
        (crest, "crest", 0.3, (7.5, 15.0, 45.0)),
    ):
        places = np.linspace(-half, half, 401)
        styles = ((BLUE, 2.4, "-"), (GREEN, 1.6, "--"), (PURPLE, 1.2, ":"))
        for (colour, width, dash), angle in zip(styles, degrees, strict=False):
            slope = math.radians(-angle if panel is valley else angle)
            force, alone = _over(slope, places)
            label = "numba" if panel is seam else f"{2 * angle:g}°"
            one = np.full(len(places), wall_stiffness() * OVERLAP) if panel is crest else alone
            panel.plot(places, force / one, dash, lw=width, color=colour, label=label)
        panel.set_title(title, fontsize=9)
        panel.set_xlabel("place [radii]")
        panel.set_ylim(0.0, 2.2)
    if shutil.which("yade"):
        coarse = np.linspace(-0.4, 0.4, 41)
        found = [_yade_over_a_seam(float(x)) for x in coarse]
        seam.plot(coarse, np.array(found) / (wall_stiffness() * OVERLAP), "--", color=ORANGE)
        seam.plot([], [], "--", color=ORANGE, label="YADE")
    seam.set_ylabel("force / force of one contact")
    seam.legend(loc="lower left")
    for panel in (valley, crest):
        panel.legend(title="turn", fontsize=7, title_fontsize=7, loc="upper center", ncols=3)
    return figure


def _over(angle: float, places: Array) -> tuple[Array, Array]:
    """Force (n,) [N] on a sphere led level over an edge, and that of its nearest point alone.

    Over a crest it is pressed in by `OVERLAP` at the edge, in a valley at the foot of both flanks.
    """
    z = R - OVERLAP if angle >= 0.0 else (R - OVERLAP) / math.cos(angle)
    x, y = R * places, 3 * R * (1 + np.arange(len(places)))
    centres = np.column_stack([x, y, np.full(len(places), z)])
    force = forces_at(centres, mesh(*ridge(angle, 3 * R * (len(places) + 1))))
    flank = np.abs(x) * math.sin(angle) + z * math.cos(angle)
    nearest = np.where(np.abs(x) < z * math.tan(angle), np.hypot(x, z), flank)
    return np.linalg.norm(force, axis=1), wall_stiffness() * (R - nearest)


def _yade_over_a_seam(place: float) -> float:
    """Force [N] of YADE on a sphere at rest above the seam of two coplanar triangles."""
    engine = YadeEngine()
    corners = np.array([[0, -0.1, 0], [0, 0.1, 0], [-0.1, 0, 0], [0.1, 0, 0]], dtype=float)
    wall = mesh(corners, np.array([[0, 1, 2], [0, 3, 1]]))
    start = Start((R * place, 0.0, R - OVERLAP))
    setup = scene(spheres_in_line(1), [start], wall, physics=still(gravity=G), duration=1e-9)
    movement = finished(engine.move(setup, time_limit_s=LIMIT_S))
    kick = movement.velocities[0] / (movement.steps * movement.timestep) + [0.0, 0.0, G]
    return float(np.linalg.norm(kick)) * setup.grain.mass


def energy() -> "Figure":
    """What the energy balance lacks, against the time step."""
    figure, panels = _panels(2)
    shares = np.array([0.4, 0.2, 0.1, 0.05, 0.025])
    kinds = zip(piles().items(), (GREEN, BLUE, ORANGE), strict=True)
    curves = [(name, physics, colour) for (name, physics), colour in kinds]
    for panel, (law, _) in zip(panels, LAWS, strict=True):
        for name, physics, colour in curves:
            lacks = [abs(lack(law, physics, float(share))) for share in shares]
            panel.loglog(shares, lacks, "o-", ms=3, color=colour, label=name)
        panel.loglog(shares, 0.5 * shares**2, color=GREY, lw=0.8, label="second order")
        panel.axvline(MARGIN, color=GREY, lw=0.8, ls=":")
        panel.set_title(law, fontsize=9)
        panel.set_xlabel("time step / stable step of one contact")
        panel.set_xticks(shares, [f"{share:g}" for share in shares], minor=False)
        panel.set_xticks([], minor=True)
    panels[0].set_ylabel("|gain| / energy turned over")
    panels[1].legend(fontsize=7)
    return figure


def incline() -> "Figure":
    """A block on a slope, around the angle of friction."""
    figure, (way, creep) = _panels(2)
    friction = math.degrees(math.atan(MU))
    for colour, over in zip((BLUE, GREEN, ORANGE), (1.0, 4.0, 8.0), strict=True):
        slope = math.radians(friction + over)
        movement = on_slope(sled(), slope, 0.5)
        t, x = _ways(movement.snapshots, slope)
        way.plot(t, 1e3 * x, "o", ms=3, color=colour, label=f"{over:g}° above")
        a = G * (math.sin(slope) - MU * math.cos(slope))
        way.plot(t, 1e3 * a * t**2 / 2, color=colour, lw=1)
    for colour, under in zip((BLUE, GREEN, ORANGE), (0.5, 2.0, 8.0), strict=True):
        slope = math.radians(friction - under)
        t, x = _ways(on_slope(sled(), slope, 0.5).snapshots, slope)
        creep.plot(t, 1e6 * x, color=colour, label=f"{under:g}° below")
    way.set_ylabel("way [mm]")
    creep.set_ylabel("way [µm]")
    for panel in (way, creep):
        panel.set_xlabel("time [s]")
        panel.legend(title="the angle of friction", fontsize=7, title_fontsize=7)
    return figure


def _ways(snapshots: object, slope: float) -> tuple[Array, Array]:
    """Times [s], and ways down the slope [m]."""
    places = snapshots["snapshot_positions"][:, 0]  # type: ignore[index]
    down = np.array([math.cos(slope), 0.0, -math.sin(slope)])
    return snapshots["snapshot_times"], (places - places[0]) @ down  # type: ignore[index]


def rolling() -> "Figure":
    """A sphere that rolling friction stops, and spheres that fall in air."""
    figure, (roll, fall) = _panels(2)
    for colour, friction in zip((BLUE, GREEN, ORANGE), (0.02, 0.05, 0.1), strict=True):
        speed = 0.2
        movement = on_slope(
            spheres_in_line(1), 0.0, 1.0, rolling=friction, speed=speed, spin=speed / R
        )
        t = movement.snapshots["snapshot_times"]
        speeds = movement.snapshots["snapshot_speeds"][:, 0]
        roll.plot(t, speeds, "o", ms=3, color=colour, label=f"{friction:g}")
        roll.plot(t, np.maximum(0.0, speed - 5 / 7 * friction * G * t), color=colour, lw=1)
    roll.set_ylabel("speed [m/s]")
    roll.legend(title="rolling friction", fontsize=7, title_fontsize=7)
    times = np.linspace(0.0, 1.0, 40)
    for colour, name, physics, curve in (
        (BLUE, "linear, 5 /s", still(gravity=G, linear_drag=5.0), _linear_fall),
        (ORANGE, "quadratic, 3 /m", still(gravity=G, quadratic_drag=3.0), _quadratic_fall),
    ):
        setup = scene(
            spheres_in_line(1), [Start((0, 0, 0))], physics=physics, duration=1.0, snapshots=times
        )
        movement = moved(setup, 1.0)
        t = movement.snapshots["snapshot_times"] - movement.timestep / 2
        speeds = movement.snapshots["snapshot_speeds"][:, 0]
        fall.plot(t, speeds, "o", ms=3, color=colour, label=name)
        fall.plot(t, curve(t), color=colour, lw=1)
    fall.set_ylabel("speed of fall [m/s]")
    fall.legend(title="drag", fontsize=7, title_fontsize=7)
    for panel in (roll, fall):
        panel.set_xlabel("time [s]")
    return figure


def _linear_fall(t: Array) -> Array:
    return np.asarray(G / 5.0 * (1 - np.exp(-5.0 * t)))


def _quadratic_fall(t: Array) -> Array:
    end = math.sqrt(G / 3.0)
    return np.asarray(end * np.tanh(G * t / end))


def rotation() -> "Figure":
    """A body with three different moments of inertia that turns over, and the error of its axis."""
    from benchmarks.engine.free_rotation import DURATION, axis_error, tumbling

    figure, (path, error) = _panels(2)
    t, engine, exact = tumbling(2e-4)
    for c, (colour, name) in enumerate(zip((BLUE, GREEN, ORANGE), "xyz", strict=True)):
        path.plot(t, engine[:, c], "o", ms=2, color=colour, label=name)
        path.plot(t, exact[:, c], color=colour, lw=1)
    path.set_xlabel("time [s]")
    path.set_ylabel("middle axis, component")
    path.legend(fontsize=7)
    steps = np.array([4e-4, 2e-4, 1e-4, 5e-5, 2.5e-5])
    error.loglog(steps, [axis_error(float(s)) for s in steps], "o-", ms=3, color=BLUE)
    error.loglog(steps, 1e-3 * (steps / 1e-4) ** 2, color=GREY, lw=0.8)
    error.text(1.1e-4, 8e-4, "second order", color=GREY, fontsize=7)
    error.set_xticks(steps, [f"{1e6 * step:g}" for step in steps], minor=False)
    error.set_xticks([], minor=True)
    error.set_xlabel("time step [µs]")
    error.set_ylabel(f"largest error of the axis in {DURATION:g} s")
    return figure
