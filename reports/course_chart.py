"""The figure of a search with insights: estimate, runs, certainty of the rankings."""

from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np

from mfopt.arrays import Array
from reports.charts import (
    BLUE,
    GREEN,
    GREY,
    LETTER,
    ORANGE,
    WIDTH,
    as_svg,
    draw_bands,
    draw_restarts,
    drawable,
    legend_below,
    scale,
    short,
    styled,
)  # fmt: skip
from reports.course import Course, bands, ranking, restarts
from reports.statistics import Comparison, median_interval
from reports.units import Display, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes

HEIGHT = 5.6  # [inch]
RATIOS = (2.1, 1.0, 0.75, 0.75)
LOG_BELOW = 0.05  # share of the work at the first change of level, below which x is logarithmic


def course(history: Course, shown: Display, name: str, confirmed: Comparison | None) -> str:
    """Belief with its band, level of each run, certainty and candidates run, over the work."""
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter, MaxNLocator, NullFormatter

    with styled():
        longest = max(len(short(name)) for name in history.levels)
        left = max(0.13, LETTER * longest + 0.055)
        figure = Figure(figsize=(WIDTH, HEIGHT))
        grid = {
            "height_ratios": RATIOS, "hspace": 0.12, "left": left, "right": 0.985,
            "bottom": 0.8 / HEIGHT, "top": 1.0 - 0.45 / HEIGHT,
        }  # fmt: skip
        axes = list(figure.subplots(4, 1, sharex=True, gridspec_kw=grid))
        if logarithmic(history):
            axes[0].set_xscale("log")
            axes[-1].xaxis.set_major_formatter(FuncFormatter(lambda value, _: number(value, 1)))
            axes[-1].xaxis.set_minor_formatter(NullFormatter())
        axes[0].set_xlim(*_ends(history))
        _belief(axes[0], history, shown, confirmed)
        axes[0].set_ylabel(f"{name}\n{short(shown.bracket)}")
        _runs(axes[1], history)
        of = ranking(history)
        axes[2].plot(of["ended"], 100.0 * of["certainty"], color=BLUE, lw=1.2, marker="o", ms=2.5)
        axes[2].set_ylim(-4.0, 104.0)
        axes[2].set_ylabel("certainty of\nranking [%]")
        axes[3].plot(of["ended"], of["runs"], color=BLUE, ls="", marker="o", ms=2.5)
        size = max(look.generation.population_size for look in history.looks)
        axes[3].set_ylim(0.0, 1.15 * max(size, *of["runs"]))
        axes[3].yaxis.set_major_locator(MaxNLocator(integer=True, nbins=4))
        axes[3].set_ylabel("runs per\ngeneration")
        axes[3].set_xlabel("work spent by the search [full runs]")
        figure.align_ylabels(axes)
        legend_below(figure, axes)
        draw_bands(axes, bands(history.places))
        draw_restarts(axes, restarts(history.places))
        return as_svg(figure)


def logarithmic(history: Course) -> bool:
    """Whether the first level would be too narrow to see on a linear axis."""
    _, began, ended = bands(history.places)[0]
    return ended - began < LOG_BELOW * float(history.spent[-1])


def _ends(history: Course) -> tuple[float, float]:
    """Where the horizontal axis begins and ends [full runs]."""
    last = float(history.spent[-1])
    if not logarithmic(history):
        return -0.01 * last, 1.03 * last
    first = min(float(history.spent[0]), *(look.ended for look in history.looks[:1]))
    return 0.7 * max(first, 1e-9 * last), 1.2 * last


def _belief(axis: "Axes", history: Course, shown: Display, confirmed: Comparison | None) -> None:
    known = [look for look in history.looks if look.insight is not None]
    label: str | None = "estimated for the recommended design, with 95\u202f% interval"
    values = []
    for _, group in groupby(known, key=lambda look: look.generation.level):
        own = [(look.ended, look.insight) for look in group if look.insight is not None]
        ended = np.array([e for e, _ in own])
        mean = drawable([i.mean * shown.factor for _, i in own])
        low, high = drawable([[end * shown.factor for end in i.interval] for _, i in own]).T
        if len(own) == 1:
            axis.errorbar(ended, mean, [mean - low, high - mean], color=BLUE, lw=1.2, capsize=2)
        axis.fill_between(ended, low, high, color=BLUE, alpha=0.18, lw=0)
        axis.plot(ended, mean, color=BLUE, lw=1.4, marker="o", ms=3.0, label=label)
        values += [mean, low, high]
        label = None
    if confirmed is not None:
        values.append(_confirmed(axis, confirmed, shown))
    every = np.concatenate([np.empty(0), *values])
    scale(axis, every)
    _limits(axis, every[np.isfinite(every)])


def _limits(axis: "Axes", values: Array) -> None:
    """Limits of the axis that hold all values, including the bounds of intervals."""
    if not values.size:
        return
    low, high = float(values.min()), float(values.max())
    if axis.get_yscale() == "log":
        axis.set_ylim(0.7 * low, 1.4 * high)
    else:
        room = 0.08 * ((high - low) or abs(high) or 1.0)
        axis.set_ylim(low - room, high + room)


def _confirmed(axis: "Axes", confirmed: Comparison, shown: Display) -> Array:
    """Draw the median over the fresh seeds, with its interval, where the search has ended."""
    place, across = 0.99, axis.get_yaxis_transform()
    within = median_interval(confirmed.best)
    ends = [] if within is None else [within.low, within.high]
    values = drawable([value * shown.factor for value in (confirmed.median_best, *ends)])
    axis.plot([place] * len(ends), values[1:], color=GREEN, lw=1.6, zorder=4, transform=across)
    axis.plot([place], values[:1], "D", color=GREEN, ms=5.0, zorder=5, transform=across,
              label="median over fresh seeds, with interval")  # fmt: skip
    return values


def _runs(axis: "Axes", history: Course) -> None:
    """A tick for each run, at its level; a cross for those that failed."""
    spent, level, failed = history.spent, history.level, history.failed
    axis.plot(spent[~failed], level[~failed], "|", color=GREY, ms=7, mew=1.0)
    if failed.any():
        axis.plot(spent[failed], level[failed], "x", color=ORANGE, ms=5, mew=1.4,
                  label="failed run")  # fmt: skip
    axis.set_yticks(range(len(history.levels)), map(short, history.levels), fontsize=8)
    axis.set_ylim(-0.5, len(history.levels) - 0.5)
    axis.set_ylabel("level of\neach run")
