"""Best design and baseline repeated on another engine, compared with runs at the target level.

Each design has one run there. One run can contradict the result, but not prove it.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from mfopt.records.evaluation import Purpose, Reference
from mfopt.records.objective import Quantity
from reports.rows import Row
from reports.units import MISSING, Display, number

DESIGNS: Mapping[str, tuple[Purpose, Purpose]] = {
    "best": ("reference best", "confirm best"),
    "baseline": ("reference baseline", "confirm baseline"),
}


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """A run on the reference engine, and the runs of the same design at the target level."""

    there: Row
    here: Row | None  # with the same seed
    spread: tuple[Row, ...]  # with all fresh seeds


@dataclass(frozen=True, slots=True, eq=False)
class Repeated:
    """The reference runs of both designs, as far as they have been made."""

    noted: Reference
    pairs: Mapping[str, Pair | None]  # "best", "baseline"


def repeated(rows: Sequence[Row], noted: Reference | None) -> Repeated | None:
    """The reference runs among the evaluations of a run; None if the study asks for none."""
    if noted is None:
        return None
    return Repeated(noted, {design: _pair(rows, *purposes) for design, purposes in DESIGNS.items()})


def _pair(rows: Sequence[Row], there: Purpose, here: Purpose) -> Pair | None:
    found = next((r for r in rows if r.purpose == there), None)
    if found is None:
        return None
    spread = tuple(r for r in rows if r.purpose == here)
    return Pair(found, next((r for r in spread if r.seed == found.seed), None), spread)


def lines(
    runs: Repeated, name: str, shown: Display, quantities: Sequence[Quantity]
) -> list[list[str]]:
    """Quantity, and for both designs: on the reference engine, at the target level, ratio."""
    asked: list[tuple[str, Display, Callable[[Row], float]]] = [
        (f"{name} [{shown.unit}]", shown, lambda row: row.value),
        *((f"{q.name} [{q.shown[1]}]", Display(*q.shown), _reader(q.name)) for q in quantities),
    ]
    return [
        [label, *(cell for design in DESIGNS for cell in _cells(runs.pairs[design], unit, read))]
        for label, unit, read in asked
    ]


def _reader(name: str) -> Callable[[Row], float]:
    return lambda row: row.quantity(name)


def _cells(pair: Pair | None, unit: Display, read: Callable[[Row], float]) -> list[str]:
    if pair is None:
        return [MISSING] * 3
    there = read(pair.there)
    here = math.nan if pair.here is None else read(pair.here)
    return [unit.text(there), unit.text(here), ratio(there, here)]


def ratio(there: float, here: float) -> str:
    """`there` over `here`; a dash unless both are finite and `here` is positive."""
    whole = math.isfinite(there) and math.isfinite(here) and here > 0.0
    return number(there / here, 3) if whole else MISSING


def words(repeats: Repeated, engine: str, shown: Display) -> str:
    """What the reference runs say.

    Args:
        repeats: the runs.
        engine: of the target level.
        shown: how values of the objective are shown.
    """
    if repeats.noted.why_not is not None:
        return f"The reference run is skipped: {repeats.noted.why_not}."
    reference = f"{repeats.noted.engine} {repeats.noted.version}"
    pairs = {design: pair for design, pair in repeats.pairs.items() if pair is not None}
    if not pairs:
        return f"The reference run on {reference} has not been made yet."
    seed = next(iter(pairs.values())).there.seed
    said = [
        f"Best design and baseline were repeated on {reference}, with the settings of the target "
        f"level and seed {seed}.",
        *(_place(design, pair, engine, shown) for design, pair in pairs.items()),
        *_verdict(pairs, engine),
        "A single run of each can contradict the result, but not prove it.",
        *_chance(pairs, engine),
    ]
    return " ".join(said)


def _place(design: str, pair: Pair, engine: str, shown: Display) -> str:
    """Where the reference run lies among the confirmation runs of its design."""
    there, name = pair.there, f"{design} design" if design == "best" else design
    if not there.finished:
        return f"The run of the {name} failed: {(there.why or there.status).splitlines()[0]}."
    values = [r.value for r in pair.spread if r.finished]
    if not values:
        return f"The {name} has no finished run on {engine} to compare with."
    low, high = min(values), max(values)
    where = "below" if there.value < low else "above" if there.value > high else "within"
    runs = f"its {len(values)} run{'s' * (len(values) > 1)} on {engine}"
    text = f"The objective of the {name}, {shown.full(there.value)}, lies {where} the range of "
    return f"{text}{runs}, {shown.text(low)} to {shown.full(high)}."


def _verdict(pairs: Mapping[str, Pair], engine: str) -> list[str]:
    """Whether the best design is better than the baseline on the reference engine, too."""
    if len(pairs) < len(DESIGNS):
        return []
    best, base = pairs["best"], pairs["baseline"]
    there, here = _better(best.there, base.there), _better(best.here, base.here)
    if there is None or here is None:
        return []
    same = f"on {engine} with the same seed"
    match there, here:
        case True, True:
            by = [_reduction(best.there, base.there), _reduction(best.here, base.here)]
            shares = f", by {by[0]}, {same} by {by[1]}" if all(by) else ""
            return [f"The best design is better than the baseline there, too{shares}."]
        case False, True:
            return [
                "The best design is not better than the baseline there, contrary to the result."
            ]
        case True, False:
            return [f"The best design is better than the baseline there, but not {same}."]
        case _:
            return [f"The best design is not better than the baseline there, nor {same}."]


def _better(best: Row | None, base: Row | None) -> bool | None:
    if best is None or base is None or not (best.finished and base.finished):
        return None
    return best.value < base.value


def _reduction(best: Row | None, base: Row | None) -> str:
    """Reduction in words; empty if a percentage has no meaning."""
    if best is None or base is None or not (base.value > 0.0 and best.value >= 0.0):
        return ""
    return f"{number(100.0 * (1.0 - best.value / base.value), 3)}\u202f%"


def _chance(pairs: Mapping[str, Pair], engine: str) -> list[str]:
    """How often a further run of one engine lies outside the range of n: in 2 of n + 1 cases."""
    n = max(sum(r.finished for r in pair.spread) for pair in pairs.values())
    if n < 2:
        return []
    share = Fraction(2, n + 1)
    return [
        f"Even a further run on {engine} would lie outside the range of {n} in {share.numerator} "
        f"of {share.denominator} cases."
    ]
