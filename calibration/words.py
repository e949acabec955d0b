"""What a calibration found, in words: warnings first, one sentence or two a line."""

import math
from itertools import combinations as pairs_of

import numpy as np

from mfopt.names import with_unit
from mfopt.records.calibration import (
    Compared,
    EmulatorCheck,
    Found,
    LeftOut,
    Offset,
    Summary,
    chance,
)

DETERMINED = 0.5  # of the prior's interval: a narrower posterior says something
WELL_DETERMINED = 0.25  # of the prior's standard deviation, of a combination
MISFIT = 0.01  # probability of a larger misfit, below which a fit is doubtful
CORRELATED = 0.5  # the least correlation for which a combination is worth a sentence
NAMED = 0.2  # of the largest weight: smaller ones are left out of a combination's name
MANY_FAILED = 0.2  # of the runs: more leave gaps in the ranges
COARSE = 1.0  # error of an emulator over scatter and noise, from which more runs help
SEPARATE = 0.25  # of an interval: wider gaps between draws do not come by chance
FEWEST_VALUES = 30  # different draws of an interval
HARDLY = 0.85  # of an interval: a recording that leaves more tells hardly anything
# A correlation r leaves sqrt(1 - r^2) of an interval once the other parameter is known: here half.
STRONG = math.sqrt(0.75)


def in_words(its: Summary) -> list[str]:
    """What an engineer wants to know; `its` has all other words."""
    return [
        *its.warnings,
        *(parameter_in_words(p, fits=its.fits) for p in its.parameters),
        *its.combinations,
        *its.trade_offs,
        *its.further,
        *(without_in_words(its, fit) for fit in its.without),
        *map(error_in_words, its.compared),
        *(offset_in_words(o) for o in its.offsets if o.notable),
        *its.check,
        f"{its.runs} simulations, {its.failed} failed, {its.cpu_s:.0f} s of CPU",
    ]


def without_in_words(its: Summary, fit: LeftOut) -> str:
    """What an error does to the intervals."""
    parts = []
    for p in its.parameters:
        low, high = fit.intervals[p.name]
        ratio = (high - low) / (p.interval[1] - p.interval[0])
        shown = " to ".join(f"{v:.{_digits((low, high))}g}" for v in (low, high))
        parts.append(f"{p.name} {with_unit(shown, p.unit)}, {100 * ratio:.0f} % as wide")
    return (
        f"Without the error {fit.error}: {'; '.join(parts)}; misfit {fit.misfit:.0f} instead of "
        f"{its.misfit:.0f} on {its.freedom} degrees of freedom"
    )


def warnings(its: Summary) -> list[str]:
    """Why the values may be wrong; empty if nothing says so."""
    lines = []
    if not its.fits:
        lines.append(
            f"The simulation does not fit: {_why_not(its)}. The values are those of a wrong model. "
            f"{_remedy(its)}"
        )
    lines += [_at_the_edge(p, fits=its.fits) for p in its.parameters if p.edge is not None]
    lines += _separate_values(its)
    if its.failed > MANY_FAILED * its.runs:
        lines.append(
            f"{its.failed} of {its.runs} simulations failed: where they fail, the emulators know "
            "nothing. See the reasons in the report, mend the simulation or narrow the ranges"
        )
    lines += [_too_sure(c, its.runs) for c in its.emulators if c.too_sure]
    return lines


def _remedy(its: Summary) -> str:
    ends = [p.name for p in its.parameters if p.asked and p.edge is not None]
    if ends:
        return f"First widen the range of {' and '.join(ends)}: the best values may lie outside"
    return "Check recordings and conditions, or add the physics that the simulation lacks"


def _why_not(its: Summary) -> str:
    said = (
        f"a misfit of {its.misfit:.0f} on {its.freedom} degrees of freedom has the probability "
        f"{chance(its.probability)}"
    )
    worst = max((c for c in its.compared if not c.held_out), key=lambda c: c.error)
    if worst.error <= 1.0:
        return said
    return (
        f"{said}; {worst.recording}, {worst.channel}, is {worst.error:.1f} times as far from the "
        "simulation as noise, scatter and stated errors explain"
    )


def _at_the_edge(its: Found, *, fits: bool) -> str:
    bound = its.low if its.edge == "lower" else its.high
    said = f"{its.name} lies at the {its.edge} end of its range, {with_unit(bound, its.unit)}"
    if not its.asked:
        return f"{said}: what the case states of it may be wrong, or the simulation lacks something"
    if bound == 0.0 and fits:
        return f"{said}: the recordings show no sign of it, so it can be left out"
    return (
        f"{said}: widen the range. If such a value makes no sense, the simulation lacks something"
    )


def _separate_values(its: Summary) -> list[str]:
    """Parameters whose draws lie in two places, with nothing between."""
    lines = []
    draws = np.sort(np.reshape(its.draws, (-1, len(its.parameters))), axis=0)
    for p, column in zip(its.parameters, draws.T, strict=True):
        low, high = p.interval
        if p.edge is not None:  # cut off there: gaps in what is left mean nothing
            continue
        within = column[(low <= column) & (column <= high)]
        if len(np.unique(within)) < FEWEST_VALUES:  # gaps between so few mean nothing
            continue
        at = int(np.argmax(np.diff(within)))
        below, above = within[at : at + 2]
        if above - below > SEPARATE * (high - low):
            lines.append(
                f"{p.name} has separate values, {low:.3g} to {below:.3g} and {above:.3g} to "
                f"{with_unit(f'{high:.3g}', p.unit)}: what lies between, the mean too, does not "
                "fit. Narrow the range to one of them, or add a recording that tells them apart"
            )
    return lines


def _too_sure(its: EmulatorCheck, runs: int) -> str:
    which = "fresh runs" if its.fresh else "runs left out of the fit"
    return (
        f"The emulator of {its.recording} is too sure: {100 * its.held:.0f} % of its 90 % "
        f"intervals hold {which}, whose mean squared error is {its.squared:.1f} times what it says "
        f"(chance explains {its.by_chance:.1f}). Intervals of the parameters may be too narrow. "
        f"Make more runs, such as --runs {2 * runs}, or narrow the ranges"
    )


def check_in_words(its: Summary) -> list[str]:
    """That the emulators know their errors, if they do, and which are large all the same."""
    if not its.emulators or any(c.too_sure for c in its.emulators):
        return []
    coarse = [
        f"The emulator of {c.recording} is coarse: near the result it allows for an error of "
        f"{c.doubt:.1f} times scatter and noise of one run, and has one of {c.error:.1f}. More "
        f"runs, such as --runs {2 * its.runs}, would narrow the intervals"
        for c in its.emulators
        if c.fresh and max(c.error, c.doubt) > COARSE
    ]
    left_out, fresh = (
        np.mean([c.held for c in its.emulators if c.fresh is which]) for which in (False, True)
    )
    return [
        f"The emulators know their errors: of their 90 % intervals {100 * left_out:.0f} % hold "
        f"runs left out of the fit, {100 * fresh:.0f} % hold fresh runs",
        *coarse,
    ]


def parameter_in_words(its: Found, *, fits: bool) -> str:
    """Value and interval."""
    mean, low, high = (f"{v:.{_digits(its.interval)}g}" for v in (its.mean, *its.interval))
    said = f"{its.name} = {with_unit(mean, its.unit)}, 90 % from {low} to {high}"
    if not fits:
        said = f"{said}, of a wrong model"
    if not its.asked:
        return f"{said} (left free, for it is not known exactly)"
    return said if its.determined else f"{said}: not determined by these recordings"


def trade_offs(its: Summary) -> list[str]:
    """Pairs of parameters of which one can stand in for the other."""
    lines = []
    for (i, a), (j, b) in pairs_of(enumerate(p.name for p in its.parameters), 2):
        r = its.correlation[i][j]
        if abs(r) > STRONG:
            lines.append(
                f"{a} and {b} trade off (correlation {r:.2f}): a larger {a} with a "
                f"{'larger' if r > 0.0 else 'smaller'} {b} changes the simulation little. Use "
                "their values together. With one known, the interval of the other would shrink to "
                f"{100 * math.sqrt(max(0.0, 1.0 - r * r)):.0f} %"
            )
    return lines


def _digits(interval: tuple[float, float]) -> int:
    """Significant digits, at least 3, with which the width of an interval shows two."""
    low, high = interval
    size = max(abs(low), abs(high))
    if not high > low:
        return 3
    return max(3, 2 + math.floor(math.log10(size)) - math.floor(math.log10(high - low)))


def further(its: Summary, *, possible: bool = True) -> list[str]:
    """Which further recording would narrow the parameters, first those not determined.

    Args:
        its: the result.
        possible: whether there are experiments that `--advise` can choose from.
    """
    asked = [p for p in its.parameters if p.asked]
    names = [p.name for p in asked if not p.determined]
    if not names and not its.advice:
        return []
    if not its.fits:
        return ["What to record next is not said: first make the simulation fit"]
    if not its.advice:
        table = (
            "" if possible else "name experiments in tables [[possible]] of the case file, then "
        )
        return [
            f"Which further recording would determine them: {table}mfopt calibrate with --advise"
        ]
    known = [a for a in its.advice if min(a.narrower.values()) < 1.0]
    lines = [
        f"Of the further recording {a.name} nothing is known: {a.failed} of its simulations failed"
        for a in its.advice
        if a not in known and a.failed
    ]
    verb = "determine" if names else "narrow"
    for name in names or [p.name for p in asked]:
        best = min(known, key=lambda a: a.narrower[name], default=None)
        if best is None or best.narrower[name] > HARDLY:
            lines.append(f"None of the {len(its.advice)} further recordings tells {name} better")
        else:
            lines.append(
                f"To {verb} {name}, record next: {best.name}; its interval would shrink to "
                f"{100 * best.narrower[name]:.0f} %"
            )
    return lines


def error_in_words(its: Compared) -> str:
    """How far simulations are from a recording."""
    kind = "held out" if its.held_out else "fitted"
    rms = float(np.sqrt(np.mean(np.subtract(its.recorded, its.simulated) ** 2)))
    off = with_unit(f"{rms:.2g}", its.unit)
    return (
        f"{its.recording}, {its.channel} ({kind}): error {off} rms, {its.error:.2f} "
        "times what noise, scatter between seeds and stated errors explain"
    )


def offset_in_words(its: Offset) -> str:
    """That an error of zero, scale or clock is larger than stated."""
    found, sd, stated = (with_unit(f"{v:.2g}", its.unit) for v in (its.found, its.sd, its.stated))
    return (
        f"{its.recording}: the {its.error} was found off by {found} (1 sd {sd}), more than the "
        f"stated {stated}"
    )


def combinations(its: Summary) -> list[str]:
    """Combinations that are known much better, or hardly at all, than single parameters say.

    Where the named parameters hardly correlate, single parameters say it all.
    """
    if all(p.determined for p in its.parameters if p.asked) or len(its.parameters) < 2:
        return []
    place = {p.name: i for i, p in enumerate(its.parameters)}
    lines = []
    for direction in its.directions:
        largest = max(abs(w) for w in direction.weights.values())
        named = {n: w for n, w in direction.weights.items() if abs(w) >= NAMED * largest}
        pairs = pairs_of((place[n] for n in named), 2)
        if max((abs(its.correlation[i][j]) for i, j in pairs), default=0.0) < CORRELATED:
            continue
        first = next(iter(named.values()))
        name = " ".join(f"{'+' if first * w > 0 else '-'} {n}" for n, w in named.items())
        said = f"The combination {name.removeprefix('+ ')} is"
        if direction.ratio < WELL_DETERMINED:
            lines.append(f"{said} determined")
        elif direction.ratio > DETERMINED:
            lines.append(f"{said} not determined: it can change without a visible difference")
    return lines
