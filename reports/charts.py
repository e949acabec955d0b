"""The figures of a report as SVG. This module only draws; other modules compute the data.

Colours are Okabe and Ito's (2008); best and baseline also differ in their dashes.
"""

import io
import math
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from mfopt.arrays import AnyArray, Array
from mfopt.records.objective import Quantity
from mfopt.records.view import DesignView
from reports.campaign import Step
from reports.course import bands, restarts
from reports.units import Display, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BLUE, ORANGE, GREEN, PURPLE, GREY = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#595959"
ORANGE_TEXT, PURPLE_TEXT = "#A84A00", "#8A3D66"  # dark enough to read: more than 4.5 : 1
WIDTH = 7.0  # [inch] text width of A4 with 16 mm margins
LOG_ABOVE = 12.0  # ratio of largest to smallest value from which a linear axis hides detail
STYLE: Any = {
    "font.size": 9.0, "font.family": "sans-serif", "svg.fonttype": "none",
    "axes.spines.top": False, "axes.spines.right": False, "axes.edgecolor": GREY,
    "axes.labelcolor": "#222222", "xtick.color": GREY, "ytick.color": GREY,
    "axes.grid": True, "grid.color": "#e6e6e6", "grid.linewidth": 0.6, "axes.axisbelow": True,
    "legend.frameon": False, "lines.linewidth": 1.7, "svg.hashsalt": "mfopt",
    "axes.unicode_minus": True, "text.parse_math": False,  # names of users are no formulas
}  # fmt: skip
TINY = 1e-100  # matplotlib squares what it draws
LONGEST_NAME = 24  # letters of a level's name in a figure
LABEL_ROW = 0.075  # height of a row of labels, of the axes' height
LETTER = 0.011  # share of the figure's width that a letter of 8 points takes
SLENDER = 0.45  # width to height of a picture, up to which four fit side by side
EDGE = 0.02  # [inch] between labels and the sides of a figure
NARROWEST = 0.3  # share of the figure's width that panels keep whatever their labels
TALLEST = 7.2  # [inch] height of all pictures of a figure: a page of A4 with its caption


def panels_over_time(
    height: float, panels: int, ratios: Sequence[float] = (), top: float = 0.1, bottom: float = 0.5
) -> "tuple[Figure, list[Axes]]":
    """Panels one above the other on one horizontal axis; heights and margins in inch."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, height))
    figure.subplots_adjust(
        left=0.1, right=0.99, bottom=bottom / height, top=1.0 - top / height, hspace=0.08
    )
    axes = figure.subplots(panels, 1, sharex=True, height_ratios=list(ratios) or None)
    return figure, list(np.atleast_1d(axes))


def keep_inside(figure: "Figure") -> None:
    """Move the sides of the panels until no label reaches beyond the figure."""
    parts = figure.subplotpars
    for _ in range(2):  # with other sides the ticks may be others
        drawn = figure.get_tightbbox()
        beyond = max(0.0, EDGE - drawn.x0), max(0.0, drawn.x1 + EDGE - figure.get_figwidth())
        left, right = (inch / figure.get_figwidth() for inch in beyond)
        if left + right > 0.0 and parts.right - parts.left - left - right > NARROWEST:
            figure.subplots_adjust(left=parts.left + left, right=parts.right - right)


def as_svg(figure: "Figure") -> str:
    """The figure as an SVG element, with every label inside."""
    keep_inside(figure)
    file = io.StringIO()
    figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None})
    text = file.getvalue()
    return text[text.index("<svg") :]


@contextmanager
def styled() -> Iterator[None]:
    """Context with the style of all figures."""
    import matplotlib

    with matplotlib.rc_context(STYLE), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing from font")  # the browser has others
        yield


def legend_below(figure: "Figure", axes: "Sequence[Axes]", columns: int = 2) -> None:
    """One legend for all panels, below them, so that no data is covered."""
    named = [pair for axis in axes for pair in zip(*axis.get_legend_handles_labels(), strict=True)]
    if named:
        handles, labels = zip(*named, strict=True)
        figure.legend(
            handles, labels, loc="lower center", ncols=columns, fontsize=8, borderaxespad=0.2
        )


def short(name: str, longest: int = LONGEST_NAME) -> str:
    """A name in one line, cut to the room that a figure has."""
    line = " ".join(name.split())
    return line if len(line) <= longest else f"{line[: longest - 1]}\u2026"


def drawable(values: ArrayLike) -> Array:
    """Values that an axis can show; nan if a sum or a square would overflow."""
    given = np.asarray(values, dtype=float)
    return np.where(np.abs(given) < 1.0 / TINY, np.where(np.abs(given) < TINY, 0.0, given), np.nan)


def round_up(value: float) -> float:
    """The next number 1, 2, 3, 4, 5, 6, 8 or 10 times a power of ten."""
    if not value > 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(value))
    return next(s * power for s in (1, 2, 3, 4, 5, 6, 8, 10, 20) if s * power >= value * 0.999)


def speed_colours(speeds: Array, top_speed: float) -> Array:
    """Colours (n, 3) of speeds (n,) [m/s]; nan gives some colour."""
    from matplotlib import colormaps

    return np.asarray(colormaps["viridis"](np.nan_to_num(speeds) / top_speed)[:, :3])


def progress(
    steps: Sequence[Step],
    shown: Display,
    name: str,
    beside: Quantity | None = None,
    bound: float | None = None,
) -> str:
    """Best and median of each generation; levels, restarts and failed runs marked.

    Args:
        steps: the generations.
        shown: how values of the objective are shown.
        name: of the objective.
        beside: a quantity of the best run, in a panel of its own.
        bound: physical lower bound of that quantity, in its unit.
    """
    from matplotlib.ticker import MaxNLocator

    with styled():
        factor, unit = (1.0, "-") if beside is None else beside.shown
        second = "" if beside is None else beside.name
        values = drawable([s.quantities.get(second, math.nan) * factor for s in steps])
        two = bool(np.isfinite(values).any())
        ratios = [1.7, 1.0][: 1 + two]
        figure, axes = panels_over_time(5.0 if two else 3.8, 1 + two, ratios, 0.45, bottom=0.95)
        place = np.array([s.generation.number for s in steps])
        best = drawable([s.best * shown.factor for s in steps])
        median = drawable([s.median * shown.factor for s in steps])
        axes[0].plot(place, median, color=GREY, lw=1.0, ls="--", marker="o", ms=2.5,
                     mfc="white", label="median of the generation")  # fmt: skip
        axes[0].plot(place, best, color=BLUE, marker="o", ms=3.5, label="best of the generation")
        scale(axes[0], np.concatenate((best, median)))
        axes[0].set_ylabel(f"{name} {short(shown.bracket)}")
        if two:
            axes[1].plot(place, values, color=BLUE, marker="o", ms=3.0)
            scale(axes[1], values)
            axes[1].set_ylabel(f"{second}\nof the best [{unit}]")
            if bound is not None:
                lowest = float(drawable(bound * factor))
                axes[1].axhline(lowest, color=GREEN, ls=":", label="physical lower bound")
        axes[0].margins(y=0.16)  # room for the marks of failed runs and restarts
        _failed(axes[0], steps)
        legend_below(figure, axes)
        axes[-1].set_xlabel("generation")
        axes[-1].xaxis.set_major_locator(MaxNLocator(integer=True))
        axes[-1].set_xlim(place[0] - 0.7, place[-1] + 0.7)
        generations = [s.generation for s in steps]
        places = [(g, g.number - 0.5, g.number + 0.5) for g in generations]
        draw_bands(axes, bands(places))
        draw_restarts(axes, restarts(places))
        return as_svg(figure)


def scale(axis: "Axes", values: Array) -> None:
    """Make the axis logarithmic if a linear axis would hide detail."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    finite = values[np.isfinite(values)]
    if not finite.size or finite.min() <= 0.0 or finite.max() <= LOG_ABOVE * finite.min():
        return
    wide = finite.max() > 1e3 * finite.min()
    axis.set_yscale("log")
    axis.yaxis.set_major_locator(LogLocator(subs=(1.0,) if wide else (1.0, 2.0, 5.0)))
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: number(value, 1)))
    axis.yaxis.set_minor_formatter(NullFormatter())


def _failed(axis: "Axes", steps: Sequence[Step]) -> None:
    """Generations with failed runs: a cross with their number along the lower edge."""
    marked = [s for s in steps if s.failed]
    if not marked:
        return
    edge = axis.get_xaxis_transform()
    axis.plot([s.generation.number for s in marked], [0.035] * len(marked), "x", color=ORANGE, ms=5,
              mew=1.4, transform=edge, clip_on=False,
              label="failed runs, with their number")  # fmt: skip
    for s in marked:
        axis.text(s.generation.number, 0.075, str(s.failed), color=ORANGE_TEXT, fontsize=7,
                  ha="center", va="bottom", transform=edge)  # fmt: skip


def _share(axis: "Axes", x: float) -> float:
    """Where `x` lies on an axis, as a share of its width."""
    return float(axis.transAxes.inverted().transform(axis.transData.transform((x, 1.0)))[0])


def draw_bands(axes: "Sequence[Axes]", stretches: Sequence[tuple[str, float, float]]) -> None:
    """Shade stretches of the horizontal axis, and name them above the first of the panels."""
    names = [short(name) for name, _, _ in stretches]
    ends = [1.0 - LETTER * (len(name) + 1) for name in names]  # or the label is cut off
    shares = [_share(axes[0], left) for _, left, _ in stretches]
    lefts = [max(0.0, min(share, end)) for share, end in zip(shares, ends, strict=True)]
    rows = label_rows(lefts, names)
    for i, (_, left, right) in enumerate(stretches):
        for axis in axes:
            axis.axvspan(left, right, color="#eef3f7" if i % 2 else "#f8f8f5", zorder=0)
        axes[0].annotate(
            names[i], (lefts[i], 1.0 + LABEL_ROW * rows[i]), xycoords="axes fraction",
            xytext=(2, 3), textcoords="offset points", fontsize=8, color="#333333",
            annotation_clip=False,
        )  # fmt: skip


def draw_restarts(axes: "Sequence[Axes]", places: Sequence[float]) -> None:
    """Mark places on the horizontal axis by R1, R2, ..."""
    names = [f"R{i}" for i in range(1, len(places) + 1)]
    rows = label_rows([_share(axes[0], place) for place in places], names)
    for place, name, row in zip(places, names, rows, strict=True):
        for axis in axes:
            axis.axvline(place, color=PURPLE, lw=1.0, ls=(0, (4, 2)))
        axes[0].annotate(name, (place, 0.99 - LABEL_ROW * row), xytext=(2, 0),
                         xycoords=axes[0].get_xaxis_transform(), textcoords="offset points",
                         color=PURPLE_TEXT, fontsize=8, va="top", weight="bold")  # fmt: skip


def label_rows(lefts: Sequence[float], labels: Sequence[str]) -> list[int]:
    """A row for each label, so that none overlap; `lefts` are rising shares of the width."""
    ends: list[float] = []
    rows = []
    for left, label in zip(lefts, labels, strict=True):
        row = next((i for i, end in enumerate(ends) if left >= end), len(ends))
        ends[row : row + 1] = [left + LETTER * (len(label) + 1)]
        rows.append(row)
    return rows


def motion(best: DesignView, baseline: DesignView | None) -> str:
    """Position and velocity of the moving part over time, on aligned panels."""
    with styled():
        figure, axes = panels_over_time(3.7, 2, [1.25, 1.0])
        lines = [(best, "best", BLUE, "-"), (baseline, "baseline", ORANGE, "--")]
        for view, label, colour, dashes in lines:
            if view is not None and len(view.motion_times):
                t = view.motion_times * 1e3
                axes[0].plot(t, view.motion_positions * 1e3, color=colour, ls=dashes, label=label)
                axes[1].plot(t, view.motion_velocities, color=colour, ls=dashes, label=label)
        for name, (time, position) in best.motion_points.items():
            axes[0].plot(time * 1e3, position * 1e3, "o", color=BLUE, mfc="white", ms=6, zorder=5)
            axes[0].annotate(name, (time * 1e3, position * 1e3), xytext=(7, -11),
                             textcoords="offset points", color=BLUE,
                             bbox={"fc": "white", "ec": "none", "pad": 0.8})  # fmt: skip
            for axis in axes:
                axis.axvline(time * 1e3, color=BLUE, lw=0.7, ls=":")
        axes[1].axhline(0.0, color=GREY, lw=0.7)
        axes[0].set_ylabel(f"{best.mover} position [mm]")
        axes[1].set_ylabel(f"{best.mover} velocity [m/s]")
        axes[1].set_xlabel(f"time since {best.clock} [ms]")
        axes[0].legend(loc="upper left")
        axes[1].margins(x=0.01)
        return as_svg(figure)


def passages(best: Sequence[Array], baseline: Sequence[Array], clock: str) -> str:
    """Share of grains that have passed, and their rate, pooled over the runs of each design.

    Args:
        best: passage times (n,) [s] of each run of the best design.
        baseline: likewise.
        clock: what they are counted from, in words.
    """
    with styled():
        figure, axes = panels_over_time(3.7, 2, [1.0, 1.1])
        every = np.concatenate([*best, *baseline]) * 1e3
        edges = np.linspace(every.min(), max(every.max(), every.min() + 1.0), 41)
        curves = [(best, "best", BLUE, "-"), (baseline, "baseline", ORANGE, "--")]
        for runs, label, colour, dashes in curves:
            if not runs:
                continue
            pooled = np.sort(np.concatenate(runs)) * 1e3
            count = np.histogram(pooled, edges)[0] / len(runs)
            rate = count / np.diff(edges) * 1e3
            share = np.linspace(0.0, 1.0, 201)
            axes[0].plot(np.quantile(pooled, share), share * 100, color=colour, ls=dashes,
                         label=f"{label} ({len(runs)} run{'s' * (len(runs) > 1)})")  # fmt: skip
            axes[1].stairs(rate, edges, color=colour, ls=dashes, lw=1.5, label=label)
            if dashes == "-":
                axes[1].stairs(rate, edges, color=colour, fill=True, alpha=0.12)
        axes[0].set_ylabel("grains passed [%]")
        axes[1].set_ylabel("rate [grains/s]")
        axes[1].set_xlabel(f"time since {clock} [ms]")
        axes[0].legend(loc="lower right")
        axes[1].set_ylim(bottom=0.0)
        return as_svg(figure)


def snapshots(
    times: Array,
    pixels: Sequence[AnyArray],
    cuts: Sequence[Array],
    extent: tuple[float, float, float, float],
    top_speed: float,
) -> str:
    """Pictures of the grains side by side with the walls' cuts, axes and one colour bar."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.collections import LineCollection
    from matplotlib.colors import Normalize
    from matplotlib.ticker import MaxNLocator

    with styled():
        mm = [1e3 * e for e in extent]
        figure, panels, bar = _panels(len(times), (mm[1] - mm[0]) / (mm[3] - mm[2]))
        for axis, time, image, lines in zip(panels, times, pixels, cuts, strict=True):
            axis.imshow(image, extent=(mm[0], mm[1], mm[2], mm[3]), interpolation="antialiased")
            axis.add_collection(LineCollection(list(lines * 1e3), colors="#222222", lw=0.9))
            axis.set_title(f"{time * 1e3:.0f} ms", fontsize=9, weight="bold", pad=4)
            axis.grid(False)
            axis.set(xlim=mm[:2], ylim=mm[2:])
            axis.xaxis.set_major_locator(MaxNLocator(5, prune="both"))  # or neighbours collide
            place = axis.get_subplotspec()
            if place is not None and place.is_last_row():
                axis.set_xlabel("x [mm]")
            if place is not None and place.is_first_col():
                axis.set_ylabel("z [mm]")
        scale = ScalarMappable(Normalize(0.0, top_speed), "viridis")
        figure.colorbar(scale, cax=bar, label="speed of the grain [m/s]", extend="max")
        return as_svg(figure)


def _panels(count: int, aspect: float) -> "tuple[Figure, list[Axes], Axes]":
    """A figure with `count` panels of that width to height, side by side or in two rows.

    The room for labels is fixed [inch]; the panels take what the page leaves.
    """
    from matplotlib.figure import Figure

    columns = count if aspect < SLENDER else math.ceil(count / 2)
    rows = math.ceil(count / columns)
    left, right, bottom, top, gap, row_gap = 0.65, 0.95, 0.5, 0.3, 0.12, 0.35
    free = WIDTH - left - right - gap * (columns - 1)
    wide = min(free / columns, aspect * (TALLEST - row_gap * (rows - 1)) / rows)
    high = wide / aspect
    width = left + columns * wide + gap * (columns - 1) + right
    height = bottom + rows * high + row_gap * (rows - 1) + top
    figure = Figure(figsize=(width, height))
    grid = {
        "left": left / width, "right": 1.0 - right / width, "bottom": bottom / height,
        "top": 1.0 - top / height, "wspace": gap / wide, "hspace": row_gap / high,
    }  # fmt: skip
    panels = figure.subplots(
        rows, columns, sharex=True, sharey=True, squeeze=False, gridspec_kw=grid
    )
    for axis in panels.flat[count:]:
        axis.axis("off")
    tall = min(3.0, rows * high) / height
    bar = figure.add_axes((1.0 - (right - 0.15) / width, bottom / height, 0.13 / width, tall))
    return figure, list(panels.flat[:count]), bar
