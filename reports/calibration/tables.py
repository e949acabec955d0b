"""The tables of a calibration's report, as text ready to be set."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mfopt.records.calibration import (
    Compared,
    EmulatorCheck,
    Found,
    Measured,
    Offset,
    Recorded,
    Summary,
)
from reports.calibration.units import brief, resolved, with_unit, words
from reports.campaign import PHASES, hours
from reports.rows import Row
from reports.units import MISSING, number

MEANING = {
    "design": "spread over the ranges",
    "refine": "around what the first runs left possible",
    "predict": "draws of the posterior, for check and prediction",
    "possible": "draws of the posterior, in experiments that nobody made yet",
}  # by purpose
USES = {True: "held out", False: "fitted"}


@dataclass(frozen=True, slots=True)
class ParameterLine:
    """A parameter, and where best and interval lie in its range."""

    name: str
    unit: str
    low: str
    high: str
    best: str
    mean: str
    interval: str
    share: str
    said: str
    low_place: float  # of the interval: 0 at the lower, 1 at the upper end of the range
    high_place: float
    best_place: float | None  # None: not determined, so the best value says nothing


def parameters(its: Summary) -> list[ParameterLine]:
    """The parameters, one line each."""
    return [_parameter(p, fits=its.fits) for p in its.parameters]


def _parameter(its: Found, *, fits: bool) -> ParameterLine:
    low, high = its.interval
    best, mean, lowest, highest = (resolved(v, its) for v in (its.best, its.mean, low, high))
    best = best if its.determined else MISSING
    said = "determined" if its.determined else "not determined"
    said = said if its.asked else "fitted along"
    more = [] if its.edge is None else [f"at the {its.edge} end"]
    more += [] if fits else ["of a wrong model"]
    return ParameterLine(
        its.name, "" if its.unit == "-" else its.unit, brief(its.low), brief(its.high),
        best, mean, f"{lowest} to {highest}", f"{number(100.0 * its.share, 2)}\u202f%",
        ", ".join([said, *more]),
        _place(its, low), _place(its, high), _place(its, its.best) if its.determined else None,
    )  # fmt: skip


def _place(its: Found, value: float) -> float:
    """Where a value lies in the range of its parameter, or in the logarithms of the range."""
    low, high, at = (math.log(v) if its.log else v for v in (its.low, its.high, value))
    return min(1.0, max(0.0, (at - low) / (high - low)))


def recordings(its: Sequence[Recorded]) -> list[list[str]]:
    """Recording, use, conditions, repeats, duration, samples of all repeats by channel."""
    return [
        [
            r.name, USES[r.held_out],
            ", ".join(f"{name} = {_condition(value)}" for name, value in r.conditions.items()),
            str(r.repeats),
            with_unit(brief(r.duration, 3), "s") if r.duration > 0.0 else MISSING,
            ", ".join(f"{words(name)}: {count}" for name, count in r.samples.items()),
        ]
        for r in its
    ]  # fmt: skip


def _condition(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def errors(compared: Sequence[Compared]) -> list[list[str]]:
    """Recording, channel, use, difference, what noise, scatter and stated errors explain, error."""
    lines = []
    for c in compared:
        away = np.array(c.recorded) - np.array(c.simulated)
        rms = float(np.sqrt(np.mean(away**2)))
        explained = float(np.sqrt(np.mean(np.square(c.expected))))
        lines.append([
            c.recording, words(c.channel), USES[c.held_out],
            with_unit(brief(rms), c.unit),
            with_unit(brief(explained), c.unit),
            f"{c.error:.2f}",
        ])  # fmt: skip
    return lines


def offsets(its: Sequence[Offset]) -> list[list[str]]:
    """Recording, error, what the case states, what was found, and the doubt about that."""
    return [
        [
            o.recording,
            words(o.error),
            *(with_unit(brief(v), o.unit) for v in (o.stated, o.found, o.sd)),
        ]
        for o in its
    ]


def advice_head(its: Summary) -> list[str]:
    """Head of the table of advice."""
    return ["further recording", *(p.name for p in its.parameters if p.asked), "failed runs"]


def advice(its: Summary) -> list[list[str]]:
    """Further recording, what it would leave of the interval of each parameter, failed runs."""
    names = [p.name for p in its.parameters if p.asked]
    return [
        [a.name, *(f"{100.0 * a.narrower[name]:.0f}\u202f%" for name in names), str(a.failed)]
        for a in its.advice
    ]


def without_head(its: Summary) -> list[str]:
    """Head of the table of fits without an error."""
    return ["error", *(p.name for p in its.parameters), "misfit"]


def without(its: Summary) -> list[list[str]]:
    """Error, interval of each parameter without it, misfit; with all errors in the first row."""
    rows = [("none", {p.name: p.interval for p in its.parameters}, its.misfit)]
    rows += [(w.error, dict(w.intervals), w.misfit) for w in its.without]
    return [
        [
            error,
            *(_between(p, *intervals[p.name]) for p in its.parameters),
            number(misfit, 2),
        ]
        for error, intervals, misfit in rows
    ]


def _between(its: Found, low: float, high: float) -> str:
    return with_unit(f"{resolved(low, its)} to {resolved(high, its)}", its.unit)


def emulators(its: Sequence[EmulatorCheck]) -> list[list[str]]:
    """Recording, runs, how many, hits of the 90 % intervals, mean square, its limit, error."""
    return [
        [
            c.recording, "fresh" if c.fresh else "left out", str(c.runs),
            f"{100.0 * c.held:.0f}\u202f%", f"{c.squared:.2f}", f"{c.by_chance:.2f}",
            f"{c.error:.2f}",
        ]
        for c in its
    ]  # fmt: skip


def noise(its: Sequence[Measured]) -> list[list[str]]:
    """Channel, standard deviation, its interval, autocorrelation time, where from."""
    lines = []
    for n in its:
        low, high = map(brief, n.sigma_range)
        lines.append([
            words(n.channel), with_unit(brief(n.sigma), n.unit),
            with_unit(f"{low} to {high}", n.unit),
            with_unit(brief(n.autocorrelation_time), "s")
            if n.autocorrelation_time > 0.0 else "none",
            n.found,
        ])  # fmt: skip
    return lines


def cost(rows: Sequence[Row]) -> list[list[str]]:
    """Runs by purpose, and their sum: purpose, meaning, runs, failed, CPU time."""
    lines = []
    for purpose, meaning in MEANING.items():
        its = [row for row in rows if row.purpose == purpose]
        if its:
            lines.append([PHASES[purpose], meaning, *_spent(its)])
    return [*lines, ["all", "", *_spent(rows)]] if len(lines) > 1 else lines


def _spent(rows: Sequence[Row]) -> list[str]:
    total = sum(row.cpu_s for row in rows)
    failed = sum(not row.finished for row in rows)
    return [str(len(rows)), str(failed), number(total / len(rows), 2), hours(total)]
