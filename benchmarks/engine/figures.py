"""Figures of the agreement campaign: what both engines give, and how far they are apart."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.engine.compare import LIMIT, Row
from benchmarks.engine.runs import Run
from mfopt.arrays import Array
from reports.charts import BLUE, GREY, ORANGE, WIDTH, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

POINTS = 300  # of a curve
BAND = (5.0, 95.0)  # percentiles over seeds
SHOWN = 0.35  # largest relative difference that is drawn


def draw_all(runs: Sequence[Run], rows: Sequence[Row], engines: Sequence[str], out: Path) -> None:
    """Draw every figure for which there are runs, as SVG in `out`."""
    out.mkdir(parents=True, exist_ok=True)
    with styled():
        for scene, draw, label in (
            ("discharge", _discharge, "discharged mass [kg]"),
            ("heap", _heap, "height [mm]"),
        ):
            done = [run for run in runs if run.scene == scene and run.finished]
            if done:
                _save(_panels(done, engines, draw, label), out / f"{scene}.svg")
        if rows:
            _save(_strip(rows), out / "differences.svg")


def _save(figure: "Figure", path: Path) -> None:
    figure.savefig(path, format="svg", metadata={"Date": None, "Creator": None})


def _panels(runs: Sequence[Run], engines: Sequence[str], draw: Any, label: str) -> "Figure":
    """A panel for each number of grains, all engines in each."""
    from matplotlib.figure import Figure

    sizes = sorted({run.grains for run in runs})
    figure = Figure(figsize=(WIDTH, 2.6), layout="constrained")
    panels = np.atleast_1d(figure.subplots(1, len(sizes), sharey=True))
    for panel, grains in zip(panels, sizes, strict=True):
        here = [run for run in runs if run.grains == grains]
        for engine, colour, dash in zip(engines, (BLUE, ORANGE), ("-", "--"), strict=False):
            own = [run for run in here if run.engine == engine]
            if own:
                draw(panel, here, own, {"color": colour, "ls": dash, "label": engine})
        panel.set_title(f"{grains} grains", fontsize=9)
    panels[0].set_ylabel(label)
    panels[0].legend()
    return figure


def _discharge(panel: "Axes", runs: Sequence[Run], own: Sequence[Run], style: Any) -> None:
    last = max(float(run.raw["exit_times"].max()) for run in runs)
    t = np.linspace(0.0, last, POINTS)
    mass = [float(run.raw["grain_mass"]) * np.searchsorted(run.raw["exit_times"], t) for run in own]
    _band(panel, t, np.array(mass), style)
    panel.set_xlabel("time [s]")


def _heap(panel: "Axes", runs: Sequence[Run], own: Sequence[Run], style: Any) -> None:
    r = np.linspace(0.0, min(float(run.raw["radii"][-1]) for run in runs), POINTS)
    height = [np.interp(r, run.raw["radii"], run.raw["heights"]) for run in own]
    _band(panel, 1e3 * r, 1e3 * np.array(height), style)
    panel.set_xlabel("distance from the axis [mm]")


def _band(panel: "Axes", x: Array, curves: Array, style: Any) -> None:
    """The mean over the seeds, and the band that holds nine tenths of them."""
    low, high = np.percentile(curves, BAND, axis=0)
    panel.fill_between(x, low, high, color=style["color"], alpha=0.2, lw=0)
    panel.plot(x, curves.mean(axis=0), **style)


def _strip(rows: Sequence[Row]) -> "Figure":
    """Relative difference and interval of every row, with the limits aimed at.

    A single run has no interval; its point is hollow. An arrow stands for what lies beyond `SHOWN`.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, 0.6 + 0.21 * len(rows)), layout="constrained")
    panel = figure.subplots()
    panel.axvspan(-100 * LIMIT, 100 * LIMIT, color=GREY, alpha=0.12, lw=0)
    panel.axvline(0.0, color=GREY, lw=0.8)
    for place, row in enumerate(rows):
        d = row.difference
        low, middle, high = 100 * np.clip([d.low, d.estimate, d.high], -SHOWN, SHOWN)
        colour = ORANGE if row.verdict == "different" else BLUE
        panel.plot([low, high], [place, place], color=colour, lw=1.4)
        filled = "none" if np.isnan(d.low) else colour
        panel.plot([middle], [place], "o", color=colour, ms=4, mfc=filled)
        for beyond, edge, arrow in ((d.low < -SHOWN, low, "<"), (d.high > SHOWN, high, ">")):
            if beyond:
                panel.plot([edge], [place], arrow, color=colour, ms=5, clip_on=False)
    panel.set_xlim(-100 * SHOWN, 100 * SHOWN)
    labels = [f"{row.scene}: {row.quantity}, {row.grains}" for row in rows]
    panel.set_yticks(range(len(rows)), labels, fontsize=8)
    panel.invert_yaxis()
    panel.set_xlabel("relative difference of the means, 95 % interval [%]")
    return figure
