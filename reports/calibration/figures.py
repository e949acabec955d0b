"""The figures of a calibration's report with their words, made once for HTML and PDF."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mfopt.names import listed
from mfopt.records.calibration import Compared, Summary
from reports.calibration import charts
from reports.calibration.units import words
from reports.figures import Figure


def best_fit_file(place: int) -> str:
    """File in the run directory: pictures at the best parameters, for the recording so placed."""
    return f"best-fit-{place}.svg"


def figures(its: Summary, directory: Path) -> dict[str, list[Figure]]:
    """The figures that this calibration has, by their place on the page."""
    return {
        "posterior": [posterior(its)],
        "fitted": [*recordings(its, held_out=False), *numbers(its, held_out=False)],
        "held_out": [*recordings(its, held_out=True), *numbers(its, held_out=True)],
        "residuals": residuals(its),
        "best_fit": best_fits(its, directory),
    }


def posterior(its: Summary) -> Figure:
    """What the recordings leave possible."""
    shown = its.parameters[: charts.MOST_PARAMETERS]
    one = len(shown) == 1
    pairs = (
        " Below the diagonal are pairs of parameters, above it their coefficients of correlation. "
        "A narrow slope means that the recordings determine a combination better than each "
        "parameter alone."
    )
    best = "Orange marks the best values of the parameters that are determined. "
    cut = f" Only the first {len(shown)} of {len(its.parameters)} parameters are shown."
    return Figure(
        charts.posterior(
            shown,
            np.array(its.draws)[:, : len(shown)],
            np.array(its.correlation)[: len(shown), : len(shown)],
        ),
        f"Histogram of {shown[0].name}."
        if one
        else f"Histograms of {listed([p.name for p in shown])}, and scatter plots of their pairs.",
        f"What the recordings leave possible: {_counted(its.draws)}. "
        + best * any(p.determined for p in shown)
        + "Dotted lines hold 90\u202f% of the draws."
        + pairs * (not one)
        + cut * (len(shown) < len(its.parameters)),
        "What the recordings leave possible",
        "natural",
    )


def _counted(draws: Sequence[Sequence[float]]) -> str:
    """How many draws there are, and how many of them differ."""
    distinct = len({tuple(draw) for draw in draws})
    said = f"{len(draws)} equally likely draws"
    return said if distinct == len(draws) else f"{said}, {distinct} of them different"


def recordings(its: Summary, *, held_out: bool) -> list[Figure]:
    """Each recording with series beside its simulations."""
    made = []
    constant = " Errors of zero, scale and clock are not in the band: all points may lie beside it."
    constant *= bool(its.offsets)
    for recording in its.recordings:
        channels = [c for c in its.compared if c.recording == recording.name and c.times]
        if recording.held_out is not held_out or not channels:
            continue
        count = recording.repeats
        of = "one repeat" if count == 1 else f"the mean over the {count} repeats"
        use = "held out: only predicted" if held_out else "fitted"
        made.append(
            Figure(
                charts.recording(channels, held_out=held_out),
                f"Recorded and simulated {listed([words(c.channel) for c in channels])} over "
                f"time in the recording {recording.name}.",
                f"{recording.name} ({use}). Points are {of}, averaged around each point. The line "
                "is the mean of runs with drawn parameters, each with a seed of its own. Of such "
                "single runs 90\u202f% lie in the band." + constant,
            )
        )
    return made


def numbers(its: Summary, *, held_out: bool) -> list[Figure]:
    """Recorded numbers beside simulated ones."""
    found = [c for c in its.compared if c.times is None and c.held_out is held_out]
    if not found:
        return []
    names = [f"{words(c.channel)} of {c.recording}" for c in found]
    return [
        Figure(
            charts.numbers(found),
            f"Recorded and simulated {listed(names)}.",
            "Recorded numbers, each the mean over the repeats, beside runs with drawn parameters. "
            "The bar holds 90\u202f% of single runs.",
        )
    ]


def residuals(its: Summary) -> list[Figure]:
    """What the simulation leaves unexplained, over time."""
    series: list[Compared] = [c for c in its.compared if c.times]
    if not series:
        return []
    return [
        Figure(
            charts.residuals(series),
            "Recorded less simulated values over time, divided by their expected scatter; a panel "
            "for each channel, a line for each recording.",
            "Residuals over time: recorded less simulated mean, divided by the standard deviation "
            "(sd) that noise, scatter and stated errors explain. If the simulation is right, about "
            "95\u202f% of the values lie in the shaded band of \u00b12. Neighbouring values are "
            "not independent. A long stretch outside of the band points to missing physics.",
        )
    ]


def best_fits(its: Summary, directory: Path) -> list[Figure]:
    """The grains in runs at the best parameters, where the simulator is a scene of mfopt."""
    made = []
    for place, recording in enumerate(its.recordings):
        try:
            svg = (directory / best_fit_file(place)).read_text(encoding="utf-8")
        except OSError:
            continue
        made.append(
            Figure(
                svg,
                "Pictures of the grains in the opened machine at rising times, coloured by their "
                "speed.",
                "Grains of one run with the best parameters under the conditions of the recording "
                f"{recording.name}, coloured by speed, seen from the front; black lines are the "
                "walls cut at y = 0.",
                f"The best fit at work: {recording.name}",
                "natural",
            )
        )
    return made
