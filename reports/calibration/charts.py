"""The figures of a calibration's report as SVG. This module only draws."""

from collections.abc import Sequence
from itertools import cycle
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from mfopt.arrays import Array
from mfopt.records.calibration import Compared, Found
from reports.calibration.units import LONG, label, tick, words
from reports.charts import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    WIDTH,
    as_svg,
    legend_below,
    panels_over_time,
    short,
    styled,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

COLOURS = (BLUE, ORANGE, GREEN, PURPLE, "#56B4E9", "#B8860B", GREY)
TALLEST = 8.4  # [inch] a page of A4 with heading and caption
PANEL = 1.45  # [inch] height of a panel over time; two figures of two fit a page
LETTERS_OF_PANEL = 20  # side by side along its height
LEGEND_ROW = 0.19  # [inch]
EXPLAINED = 2.0  # standard deviations that about 95 % of residuals do not exceed
BINS = 24
MEETING = 0.1  # of an axis, from its end
MANY_TICKS = 20.0  # ratio of the ends of an axis, from which only powers of ten are marked
LETTERS = 96  # of the names of all parameters side by side
MOST_PARAMETERS = 7  # of a posterior figure: more are too small to read


def recording(channels: Sequence[Compared], *, held_out: bool) -> str:
    """Recorded points and simulated mean with its band over time, a panel a channel."""
    with styled():
        colour = ORANGE if held_out else BLUE
        height = min(TALLEST, 0.9 + PANEL * len(channels))
        figure, axes = panels_over_time(height, len(channels), bottom=0.75)
        for axis, its in zip(axes, channels, strict=True):
            t = np.array(its.times)
            axis.fill_between(t, its.low, its.high, color=colour, alpha=0.2, lw=0.0,
                              label="simulated: 90 % of single runs")  # fmt: skip
            axis.plot(t, its.simulated, color=colour, ls="--" if held_out else "-",
                      label="simulated: mean")  # fmt: skip
            axis.plot(t, its.recorded, "o", color="#222222", ms=2.6, mfc="white", mew=0.8,
                      label="recorded")  # fmt: skip
            axis.set_ylabel(wrapped(label(words(its.channel), its.unit)))
            _ticks(axis.yaxis, its.high)
            axis.margins(x=0.01)
        axes[-1].set_xlabel(label("time", "s"))
        figure.align_ylabels(axes)
        legend_below(figure, axes[:1], columns=3)
        return as_svg(figure)


def residuals(compared: Sequence[Compared]) -> str:
    """Recorded less simulated over time, over what is explained; a panel a channel."""
    with styled():
        channels = list(dict.fromkeys(c.channel for c in compared))
        names = list(dict.fromkeys(c.recording for c in compared))
        looks = dict(
            zip(names, zip(cycle(COLOURS), _dashes(len(names)), strict=False), strict=False)
        )
        rows = -(-len(names) // 2)
        bottom = 0.6 + LEGEND_ROW * rows
        height = min(TALLEST, 0.1 + bottom + PANEL * len(channels))
        figure, axes = panels_over_time(height, len(channels), bottom=bottom)
        largest = EXPLAINED
        for axis, channel in zip(axes, channels, strict=True):
            axis.axhspan(-EXPLAINED, EXPLAINED, color="#eef3f7", zorder=0)
            axis.axhline(0.0, color=GREY, lw=0.7)
            for its in compared:
                if its.channel == channel:
                    away = residual(its)
                    largest = max(largest, float(np.max(np.abs(away))))
                    colour, dashes = looks[its.recording]
                    axis.plot(np.array(its.times), away, color=colour, lw=1.3, ls=dashes)
            axis.set_ylabel(f"{wrapped(words(channel))}\nresidual / sd")
            axis.margins(x=0.01)
        for axis in axes:
            axis.set_ylim(-1.1 * largest, 1.1 * largest)
        held = {c.recording for c in compared if c.held_out}
        for name, (colour, dashes) in looks.items():
            text = short(name, 40) + " (held out)" * (name in held)
            axes[0].plot([], [], color=colour, ls=dashes, lw=1.3, label=text)
        axes[-1].set_xlabel(label("time", "s"))
        figure.align_ylabels(axes)
        legend_below(figure, axes[:1])
        return as_svg(figure)


def residual(its: Compared) -> Array:
    """Recorded less simulated (m,), in standard deviations of what all known errors explain."""
    expected = np.array(its.expected)
    away = np.array(its.recorded) - np.array(its.simulated)
    return np.where(expected > 0.0, away / expected, 0.0)


def inner_ticks(low: float, high: float, count: int) -> list[float]:
    """Round numbers, none so near an end that the label meets that of the next panel."""
    from matplotlib.ticker import MaxNLocator

    found = [float(t) for t in MaxNLocator(count).tick_values(low, high) if low <= t <= high]
    free = MEETING * (high - low)
    return [t for t in found if low + free < t < high - free] or found


def wrapped(name: str) -> str:
    """A name in lines that are no longer than a panel over time is high."""
    return fill(name, LETTERS_OF_PANEL)


def _ticks(side: "Axis", values: ArrayLike) -> None:
    """Powers of ten at each tick, where matplotlib would set them beside the axis."""
    if not 10.0 ** (1 - LONG) < float(np.max(np.abs(values))) < 10.0**LONG:
        side.set_major_formatter(tick)


def _dashes(count: int) -> list[str]:
    """Line styles: a colour that returns has another one."""
    kinds = ("-", "--", ":", "-.")
    return [kinds[(i // len(COLOURS)) % len(kinds)] for i in range(count)]


def numbers(compared: Sequence[Compared]) -> str:
    """Recorded numbers beside the simulated ones, a strip each."""
    from matplotlib.figure import Figure

    with styled():
        count = len(compared)
        height = 0.5 + 0.85 * count
        figure = Figure(figsize=(WIDTH, height))
        axes = np.atleast_1d(figure.subplots(count, 1, squeeze=True))
        figure.subplots_adjust(
            left=0.34, right=0.97, top=1.0 - 0.08 / height, bottom=0.72 / height, hspace=1.25
        )
        for axis, its in zip(axes, compared, strict=True):
            _strip(axis, its)
        legend_below(figure, list(axes[:1]), columns=2)
        return as_svg(figure)


def _strip(axis: "Axes", its: Compared) -> None:
    seen, mean, low, high = (v[0] for v in (its.recorded, its.simulated, its.low, its.high))
    axis.errorbar([mean], [0.0], xerr=[[mean - low], [high - mean]], fmt="s", ms=5, capsize=3,
                  color=ORANGE if its.held_out else BLUE,
                  label="simulated: mean, 90 % of single runs")  # fmt: skip
    axis.plot([seen], [0.0], "o", color="#222222", ms=6, mfc="white", mew=1.3, label="recorded")
    axis.set(yticks=[0.0], ylim=(-1.0, 1.0), xlabel=label(words(its.channel), its.unit))
    _ticks(axis.xaxis, its.high)
    axis.set_yticklabels([short(its.recording, 30) + "\n(held out)" * its.held_out])
    axis.margins(x=0.15)


def posterior(parameters: Sequence[Found], draws: Array, correlation: Array) -> str:
    """Histograms on the diagonal, pairs of draws below, coefficients of correlation above."""
    from matplotlib.figure import Figure

    with styled():
        count = len(parameters)
        side = min(WIDTH, 1.6 + 1.2 * count)
        height = side * (0.94 if count > 1 else 0.65)
        figure = Figure(figsize=(side, height))
        axes = figure.subplots(count, count, squeeze=False)
        figure.subplots_adjust(
            left=0.72 / side, right=1.0 - 0.12 / side, bottom=0.55 / height,
            top=1.0 - 0.12 / height, wspace=0.09, hspace=0.09,
        )  # fmt: skip
        for row in range(count):
            for column in range(count):
                axis = axes[row, column]
                if row == column:
                    _histogram(axis, parameters[row], draws[:, row])
                elif row > column:
                    axis.plot(draws[:, column], draws[:, row], "o", color=BLUE, ms=1.8,
                              mew=0.0, alpha=0.45)  # fmt: skip
                    if parameters[column].determined and parameters[row].determined:
                        axis.plot(parameters[column].best, parameters[row].best, "+",
                              color=ORANGE, ms=9, mew=1.8)  # fmt: skip
                else:
                    _coefficient(axis, float(correlation[row, column]))
                if row >= column:
                    _axes(axis, parameters, draws, row, column)
        return as_svg(figure)


def _histogram(axis: "Axes", its: Found, values: Array) -> None:
    low, high = _limits(its, values)
    edges = np.geomspace(low, high, BINS + 1) if its.log else np.linspace(low, high, BINS + 1)
    axis.hist(values, edges.tolist(), color=BLUE, alpha=0.35, histtype="stepfilled")
    if its.determined:
        axis.axvline(its.best, color=ORANGE, lw=1.5)
    for end in its.interval:
        axis.axvline(end, color=GREY, lw=1.0, ls=":")


def _limits(its: Found, values: Array) -> tuple[float, float]:
    """The ends of an axis that holds all draws."""
    low, high = float(values.min()), float(values.max())
    if its.log:
        wide = max((high / low) ** 0.06, 1.0 + 1e-9)
        return low / wide, high * wide
    wide = max(0.06 * (high - low), 1e-9 * abs(high), 1e-30)
    return low - wide, high + wide


def _coefficient(axis: "Axes", value: float) -> None:
    axis.axis("off")
    axis.text(0.5, 0.5, f"{value:+.2f}".replace("-", "\u2212"), ha="center", va="center",
              transform=axis.transAxes, color="#222222", fontsize=9 + 3 * abs(value))  # fmt: skip


def _axes(axis: "Axes", parameters: Sequence[Found], values: Array, row: int, column: int) -> None:
    """Limits, ticks and labels: at the left and lower edge only."""
    from matplotlib.ticker import FixedLocator, LogLocator, NullFormatter

    last = len(parameters) - 1
    size = 8.0 if last < 4 else 6.5
    longest = LETTERS // len(parameters)
    names = [label(short(p.name, longest), p.unit) for p in parameters]
    ends = [_limits(parameters[k], values[:, k]) for k in (column, row)]
    sides: list[tuple[Axis, int, bool]] = [(axis.xaxis, column, row == last)]
    axis.set_xlim(*ends[0])
    if parameters[column].log:
        axis.set_xscale("log")
    if row == column:
        axis.set_yticks([])
        axis.spines["left"].set_visible(False)
    else:
        axis.set_ylim(*ends[1])
        if parameters[row].log:
            axis.set_yscale("log")
        sides.append((axis.yaxis, row, column == 0))
    for side, k, labelled in sides:
        if parameters[k].log:
            low, high = _limits(parameters[k], values[:, k])
            subs = (1.0, 2.0, 5.0) if high < MANY_TICKS * low else (1.0,)
            side.set_major_locator(LogLocator(subs=subs, numticks=5))
            side.set_major_formatter(tick)
            side.set_minor_formatter(NullFormatter())
        else:
            count = 3 if last > 1 else 4
            side.set_major_locator(
                FixedLocator(inner_ticks(*_limits(parameters[k], values[:, k]), count))
            )
            _ticks(side, values[:, k])
        side.set_tick_params(labelsize=7.5, labelbottom=labelled, labelleft=labelled)
    if row == last:
        axis.set_xlabel(names[column], fontsize=size)
    if column == 0 and row > 0:
        axis.set_ylabel(names[row], fontsize=size)
