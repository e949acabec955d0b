"""The first table of a report: the quantities that an engineer asks of the machine.

The objective is a sum. This table shows each quantity alone, so none can hide another.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mfopt.records.objective import Quantity
from reports.result import Result
from reports.rows import Row
from reports.statistics import median
from reports.units import Display

SIMPLE = "best start"


@dataclass(frozen=True, slots=True)
class Spread:
    """One quantity over the runs of one design, in SI units."""

    median: float
    low: float
    high: float
    runs: int
    failed: int  # runs besides these
    without: int  # finished runs besides these, which give no value
    over: int  # of the runs, those above the limit


@dataclass(frozen=True, slots=True)
class Need:
    """One quantity for each of the designs that are compared."""

    name: str
    unit: str  # of the numbers, SI; "-" for a share
    shown: Display
    limit: float | None  # that the study sets
    wanted: float | None  # value that the study asks for
    lower_is_better: bool
    spreads: Mapping[str, Spread]  # by design; "best" and "baseline" first

    @property
    def label(self) -> str:
        """The name with the unit that it is shown in."""
        return f"{self.name} [{self.shown.unit}]"

    @property
    def asked(self) -> str:
        """The limit or the wanted value in words; empty without one."""
        if self.wanted is not None:
            return f"wanted {self.text(self.wanted)}"
        return "" if self.limit is None else f"at most {self.text(self.limit)}"

    def text(self, value: float) -> str:
        """A value as the table shows it."""
        return self.shown.text(value, 3)

    def range(self, design: str) -> str:
        """Smallest and largest value over the runs; empty for one run, or if both are equal."""
        spread = self.spreads[design]
        low, high = self.text(spread.low), self.text(spread.high)
        return "" if spread.runs < 2 or low == high else f"{low} to {high}"

    def fault(self, design: str) -> str:
        """What is wrong with this design, in words; empty if nothing is."""
        spread, base = self.spreads[design], self.spreads.get("baseline")
        said = []
        if spread.failed:
            made = spread.runs + spread.failed + spread.without
            said.append(f"{spread.failed} of {made} runs failed")
        if spread.without:
            said.append(f"no value in {spread.without} of {spread.runs + spread.without} runs")
        if spread.over:
            said.append(f"above the limit in {spread.over} of {spread.runs} runs")
        if base and self._worse(spread.median, base.median):
            said.append("worse than the baseline")
        return ", ".join(said)

    def _worse(self, value: float, other: float) -> bool:
        """Whether a value is worse than another; values that read alike are not."""
        worse = self.lower_is_better and value > other
        return worse and self.text(value) != self.text(other)

    def sentence(self) -> str:
        """The quantity of all designs in one line."""
        said = list(filter(None, [self.asked]))
        for design, spread in self.spreads.items():
            extra = ", ".join(filter(None, (self.range(design), self.fault(design).upper())))
            said.append(f"{design} {self.text(spread.median)}" + (f" ({extra})" if extra else ""))
        return ", ".join(said)


def needs(
    rows: Sequence[Row], result: Result | None, quantities: Sequence[Quantity]
) -> tuple[Need, ...]:
    """The quantities of the designs that fresh seeds compare.

    Before the confirmation the best design has the run that found it. Empty where runs are of
    another kind.
    """
    if result is None:
        return ()
    runs: dict[str, Sequence[Row]] = {
        "best": result.confirmations or (result.found,),
        "baseline": result.baseline,
    }
    if (simple := _best_start(rows)) and not np.array_equal(simple[0].x, result.x):
        runs[SIMPLE] = simple
    made = [
        Need(
            q.name,
            q.unit,
            Display(*q.shown),
            q.limit,
            q.wanted,
            q.lower_is_better,
            _spreads(runs, q.name, q.limit),
        )
        for q in quantities
    ]
    return tuple(need for need in made if "best" in need.spreads)


def _best_start(rows: Sequence[Row]) -> list[Row]:
    """Runs at the target of the best design among the starts; none if it was no finalist."""
    starts: dict[bytes, list[float]] = {}
    for row in rows:
        if row.purpose == "start":
            starts.setdefault(row.x.tobytes(), []).append(row.value)
    best = min(starts, key=lambda x: sum(starts[x]) / len(starts[x]), default=None)
    return [row for row in rows if row.purpose == "finalist" and row.x.tobytes() == best]


def _spreads(
    runs: Mapping[str, Sequence[Row]], name: str, limit: float | None = None
) -> dict[str, Spread]:
    """One quantity of each design that has a finished run which gives it."""
    made = {}
    for design, own in runs.items():
        given = [row.quantity(name) for row in own if row.finished]
        values = [value for value in given if math.isfinite(value)]
        if values:
            over = 0 if limit is None else sum(value > limit for value in values)
            failed, without = len(own) - len(given), len(given) - len(values)
            made[design] = Spread(
                median(values), min(values), max(values), len(values), failed, without, over
            )
    return made
