"""The figures of a diagnosis as SVG. This module only draws."""

from collections.abc import Sequence

import numpy as np

from mfopt.records.diagnosis import Beside, Place, Suspected
from reports.calibration.units import label, words
from reports.charts import (
    BLUE,
    GREY,
    ORANGE,
    WIDTH,
    as_svg,
    legend_below,
    panels_over_time,
    short,
    styled,
)

ROW = 0.27  # [inch] height of a row of cells or bars
PANEL = 1.45  # [inch] height of a panel over time
TALLEST = 8.4  # [inch] a page of A4 with heading and caption
MOST_BARS = 14
# [standard deviations] at which a cell has its darkest colour; where some are far larger, the
# colours rise with the logarithm from `FAINT` on.
CLEAR, FAINT = 3.0, 0.5
MARKS = (0.5, 1, 3, 10, 30, 100, 300, 1000, 3000, 10_000)  # on the logarithmic scale
NAMED = 0.8  # probability from which an effect is named


def places(its: Sequence[Place]) -> str:
    """Cells of recording and channel over time, coloured by the mismatch; a frame stands out."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, LogNorm, Normalize
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle

    with styled():
        rows = list(dict.fromkeys((p.recording, p.channel) for p in its))
        height = 1.1 + ROW * len(rows)
        figure = Figure(figsize=(WIDTH, height))
        axis = figure.add_axes((0.34, 0.62 / height, 0.52, (height - 0.72) / height))
        colours = LinearSegmentedColormap.from_list("mismatch", ["#f3f5f7", "#f2b48a", ORANGE])
        largest = max(p.difference for p in its)
        wide = largest > 2.0 * CLEAR
        scale = LogNorm(FAINT, largest, clip=True) if wide else Normalize(0.0, CLEAR, clip=True)
        end = max(p.end for p in its) or 1.0
        for p in its:
            y = rows.index((p.recording, p.channel))
            left, right = p.start, p.end if p.end > p.start else end
            colour = colours(scale(p.difference))
            axis.add_patch(Rectangle((left, y - 0.42), right - left, 0.84, fc=colour, ec="white",
                                     lw=0.8))  # fmt: skip
            if p.stands_out:
                axis.add_patch(Rectangle((left, y - 0.38), right - left, 0.76, fill=False,
                                         ec="#222222", lw=1.2))  # fmt: skip
        axis.set(xlim=(0.0, end), ylim=(len(rows) - 0.5, -0.5))
        names = [f"{short(r, 22)}, {short(words(c), 18)}" for r, c in rows]
        axis.set_yticks(range(len(rows)), names, fontsize=8)
        axis.tick_params(left=False)
        axis.grid(False)
        axis.spines["left"].set_visible(False)
        axis.set_xlabel(label("time", "s"))
        bar = figure.add_axes((0.89, 0.62 / height, 0.018, (height - 0.72) / height))
        beside = figure.colorbar(ScalarMappable(scale, colours), cax=bar, label="difference / sd",
                                 extend="neither" if wide else "max")  # fmt: skip
        if wide:
            marks = [m for m in MARKS if m <= largest]
            beside.set_ticks(marks, labels=[f"{m:g}" for m in marks])
            beside.minorticks_off()
        return as_svg(figure)


def suspects(its: Sequence[Suspected], nothing: float, other: float) -> str:
    """Probabilities of nothing, of each effect and of something else, as bars."""
    from matplotlib.figure import Figure

    with styled():
        chosen = list(its[:MOST_BARS])
        names = [
            "nothing is missing",
            *(s.name.replace("_", " ").replace(".", ": ") for s in chosen),
            "something unknown",
        ]
        values = [nothing, *(s.probability for s in chosen), other]
        colours = [GREY, *(ORANGE if s.measuring else BLUE for s in chosen), GREY]
        height = 0.95 + ROW * len(names)
        figure = Figure(figsize=(WIDTH, height))
        axis = figure.add_axes((0.3, 0.78 / height, 0.62, (height - 0.88) / height))
        axis.barh(range(len(names)), values, color=colours, height=0.66)
        for y, value in enumerate(values):
            axis.text(value + 0.01, y, f"{value:.2f}", va="center", fontsize=8, color="#222222")
        axis.axvline(NAMED, color="#222222", lw=0.9, ls=":")
        axis.set(xlim=(0.0, 1.07), ylim=(len(names) - 0.4, -0.6))
        axis.set_yticks(range(len(names)), [short(n, 34) for n in names], fontsize=8)
        axis.tick_params(left=False)
        axis.grid(False, axis="y")
        axis.set_xlabel("probability")
        for colour, text in ((BLUE, "grains or machine"), (ORANGE, "camera or sensor")):
            axis.barh([0], [0.0], color=colour, label=text)
        legend_below(figure, [axis])
        return as_svg(figure)


def recording(channels: Sequence[Beside]) -> str:
    """Recorded points, and simulations without and with the likeliest effect; a panel a channel."""
    with styled():
        height = min(TALLEST, 0.9 + PANEL * len(channels))
        figure, axes = panels_over_time(height, len(channels), bottom=0.75)
        for axis, its in zip(axes, channels, strict=True):
            t = np.array(its.times)
            seen, before, after, sd = map(np.array, (its.recorded, its.before, its.after, its.sd))
            axis.fill_between(t, after - 2.0 * sd, after + 2.0 * sd, color=BLUE, alpha=0.18, lw=0.0,
                              label="2 sd of the mean of the repeats")  # fmt: skip
            axis.plot(t, before, color=ORANGE, ls="--", label="simulated without the effect")
            axis.plot(t, after, color=BLUE, label="simulated with the effect")
            axis.plot(t, seen, "o", color="#222222", ms=2.6, mfc="white", mew=0.8, label="recorded")
            axis.set_ylabel(label(words(its.channel), its.unit))
            axis.margins(x=0.01)
        axes[-1].set_xlabel(label("time", "s"))
        figure.align_ylabels(axes)
        legend_below(figure, axes[:1], columns=2)
        return as_svg(figure)
