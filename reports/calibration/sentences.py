"""The result of a calibration in words."""

from collections.abc import Sequence

from mfopt.names import listed
from mfopt.records.calibration import Compared, Found, Summary, chance
from reports.calibration.units import powers, resolved, with_unit
from reports.units import MINUS, number

HALF = 0.5  # of the interval before: narrower ones are not determined for another reason


def sentence(its: Summary) -> str:
    """Values, what the recordings do not determine, and whether the simulation fits."""
    asked = [p for p in its.parameters if p.asked]
    known = [
        f"{p.name} = {value(p)} (90\u202f% interval {interval(p)})" for p in asked if p.determined
    ]
    lost = [p.name for p in asked if not p.determined]
    said = [] if its.fits else [fit(its)]
    if known and its.fits:
        said.append(f"The recordings determine {listed(known)}.")
    elif known:
        said.append(f"In that model {listed(known)}.")
    if lost:
        nobody = "They" if known and its.fits else "The recordings"
        said.append(f"{nobody} do not determine {listed(lost)}.")
    if its.trade_offs:
        said.append("Some values hold only together, as is said below.")
    if its.fits:
        said.append(fit(its))
    return " ".join([*said, *held_out(its.compared)])


def value(its: Found) -> str:
    """The mean with its unit."""
    return with_unit(resolved(its.mean, its), its.unit)


def interval(its: Found) -> str:
    """The 90 % interval with its unit."""
    low, high = (resolved(v, its) for v in its.interval)
    return with_unit(f"{low} to {high}", its.unit)


def fit(its: Summary) -> str:
    """Whether the simulation fits, in short."""
    if its.fits:
        return "The simulation fits the recordings."
    return "The simulation does not fit the recordings, so the values are those of a wrong model."


def misfit(its: Summary) -> str:
    """Whether the simulation fits, with the numbers behind it."""
    one = f"{its.freedom} degree{'s' * (its.freedom != 1)} of freedom"
    larger = chance(its.probability)
    return (
        f"The misfit (chi-squared) of the checking runs is {number(its.misfit, 3)} on {one}. If "
        f"the simulation is right, a larger misfit has the probability {larger}. The logarithm of "
        f"the evidence is {number(its.log_evidence, 3)}; the larger evidence of two simulations "
        "of the same recordings marks the better one."
    )


def held_out(compared: Sequence[Compared]) -> list[str]:
    """How well recordings that were not fitted are predicted; empty without any."""
    errors = [c.error for c in compared if c.held_out]
    if not errors:
        return []
    largest = f"{max(errors):.2f} times what noise, scatter and stated errors explain"
    if len(errors) == 1:
        return [f"The error of the held-out prediction is {largest}."]
    return [f"The largest error of the held-out predictions is {largest}."]


def undetermined(its: Summary) -> list[str]:
    """What the recordings do not determine, one sentence a line; empty if nothing is missing."""
    lines = [
        f"{p.name} is not determined: {interval(p)} has 90\u202f% probability, which is "
        f"{number(100.0 * p.share, 2)}\u202f% of what was possible before."
        for p in its.parameters
        if p.asked and not p.determined and p.share >= HALF
    ]
    lines += [
        f"{p.name} is not determined: it lies at the {p.edge} end of its range, in a model that "
        "does not fit."
        for p in its.parameters
        if p.asked and not p.determined and p.share < HALF
    ]
    lines += [typeset(line) for line in (*its.combinations, *its.trade_offs)]
    lines += [
        f"{p.name} was fitted along, because it is not known exactly. Its uncertainty is part of "
        "all intervals."
        for p in its.parameters
        if not p.asked
    ]
    return lines


def typeset(line: str) -> str:
    """A line of the words of a calibration as a sentence of a page."""
    signs = line.replace(" - ", f" {MINUS} ").replace("(correlation -", f"(correlation {MINUS}")
    return powers(signs).replace(" %", "\u202f%") + "."
