"""The figures of a diagnosis' report with their words, made once for HTML and PDF."""

from mfopt.names import listed
from mfopt.records.diagnosis import Diagnosis
from reports.calibration.units import words
from reports.diagnosis import charts
from reports.figures import Figure


def figures(its: Diagnosis) -> dict[str, list[Figure]]:
    """The figures that this diagnosis has, by their place on the page."""
    return {
        "where": [where(its)],
        "what": [what(its)],
        "fitted": recordings(its, held_out=False),
        "held_out": recordings(its, held_out=True),
    }


def where(its: Diagnosis) -> Figure:
    """Where simulation and recordings differ."""
    return Figure(
        charts.places(its.places),
        "Cells over time, a row for each channel of each recording, coloured by the difference "
        "between recordings and simulation.",
        "Where simulation and recordings differ. The colour is what is missing in the best fit, in "
        "standard deviations (sd) of the mean of the repeats. A frame marks cells that stand out "
        "by themselves: in 5\u202f% of recordings without a mismatch any cell does.",
    )


def what(its: Diagnosis) -> Figure:
    """How likely each effect is."""
    return Figure(
        charts.suspects(its.suspects, its.nothing, its.other),
        "Bars: the probability that nothing is missing, of each effect, and of something unknown.",
        "Probability that each effect is there, alone or with another one. An effect is named from "
        "0.8 on, the dotted line, if the fit leaves nothing unexplained and no recording speaks "
        "against it.",
    )


def recordings(its: Diagnosis, *, held_out: bool) -> list[Figure]:
    """Each recording beside simulations without and with the likeliest effect."""
    made = []
    for name in dict.fromkeys(b.recording for b in its.beside if b.held_out is held_out):
        channels = [b for b in its.beside if b.recording == name and b.times]
        if not channels:
            continue
        use = "held out: took no part" if held_out else "fitted"
        made.append(
            Figure(
                charts.recording(channels),
                f"Recorded and simulated {listed([words(c.channel) for c in channels])} over "
                f"time in the recording {name}.",
                f"{name} ({use}). Points are the mean over the repeats. Lines are the mean of "
                "simulations at the best fit without any effect, and with the likeliest one.",
            )
        )
    return made
