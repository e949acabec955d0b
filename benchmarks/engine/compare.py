"""The runs of two engines compared, quantity by quantity, as records, Markdown and JSON."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from benchmarks.engine.quantities import QUANTITIES, Quantity
from benchmarks.engine.runs import Run
from benchmarks.engine.statistics import (
    Interval,
    distribution_p,
    holm,
    permutation_p,
    relative_difference,
    runs_needed,
    smallest_p,
)
from mfopt.arrays import Array, frozen

LEVEL = 0.01  # family-wise, over all rows of two engines
LIMIT = 0.05  # within which the interval of the relative difference shall lie


@dataclass(frozen=True, slots=True, eq=False)
class Sample:
    """One quantity over the runs of one engine."""

    engine: str
    quantity: Quantity
    scene: str
    grains: int
    numbers: Array  # (runs,) of the finished ones
    distributions: tuple[Array, ...]  # of the finished ones; empty without a distribution
    failed: int
    cpu_s: float  # mean of the finished runs; nan without any

    @property
    def scatter(self) -> float:
        """Standard deviation between seeds over the mean; nan for a single run."""
        if len(self.numbers) < 2:
            return math.nan
        return float(self.numbers.std(ddof=1) / abs(self.numbers.mean()))


@dataclass(frozen=True, slots=True)
class Row:
    """One quantity on two engines."""

    scene: str
    quantity: str
    unit: str
    grains: int
    runs: tuple[int, int]  # of the reference and the other engine, finished
    failed: tuple[int, int]
    means: tuple[float, float]
    difference: Interval  # of the means, over that of the reference
    p: float
    distance: float | None  # of distribution functions, where distributions are compared
    needed: int | None  # runs of each until the interval would be inside `LIMIT`
    p_family: float = math.nan  # Holm's
    p_least: float = math.nan  # the smallest that so few runs can give, times the rows

    @property
    def verdict(self) -> str:
        """What the test says at the family-wise level."""
        if self.p_family < LEVEL:
            return "different"
        return "no difference" if self.p_least < LEVEL else "too few runs to tell"


def samples(runs: Sequence[Run], engine: str) -> list[Sample]:
    """Every quantity and size of which the engine has runs."""
    made = []
    own = [run for run in runs if run.engine == engine]
    for scene, grains in sorted({(run.scene, run.grains) for run in own}):
        group = [run for run in own if (run.scene, run.grains) == (scene, grains)]
        made += [_sample(engine, q, group) for q in QUANTITIES if q.of(group[0])]
    return made


def _sample(engine: str, quantity: Quantity, group: Sequence[Run]) -> Sample:
    done = [run for run in group if run.finished]
    values = quantity.values
    return Sample(
        engine=engine,
        quantity=quantity,
        scene=group[0].scene,
        grains=group[0].grains,
        numbers=frozen([quantity.number(run.raw) for run in done]),
        distributions=() if values is None else tuple(values(run.raw) for run in done),
        failed=len(group) - len(done),
        cpu_s=float(np.mean([run.cpu_s for run in done])) if done else math.nan,
    )


def compare(runs: Sequence[Run], reference: str, other: str) -> list[Row]:
    """One row for every quantity and size of which both engines have finished runs."""
    pairs = list(_pairs(samples(runs, reference), samples(runs, other)))
    rows = [_row(a, b) for a, b in pairs]
    family = holm([row.p for row in rows])
    return [
        replace(row, p_family=p, p_least=min(1.0, len(rows) * smallest_p(*row.runs)))
        for row, p in zip(rows, family, strict=True)
    ]


def _pairs(reference: Sequence[Sample], other: Sequence[Sample]) -> Iterator[tuple[Sample, Sample]]:
    there = {(s.scene, s.quantity.name, s.grains): s for s in other}
    for sample in reference:
        peer = there.get((sample.scene, sample.quantity.name, sample.grains))
        if peer is not None and len(peer.numbers) and len(sample.numbers):
            yield sample, peer


def _row(a: Sample, b: Sample) -> Row:
    distance = None
    if a.distributions:
        p, distance = distribution_p(a.distributions, b.distributions)
    else:
        p = permutation_p(a.numbers, b.numbers)
    return Row(
        scene=a.scene,
        quantity=a.quantity.name,
        unit=a.quantity.unit,
        grains=a.grains,
        runs=(len(a.numbers), len(b.numbers)),
        failed=(a.failed, b.failed),
        means=(float(a.numbers.mean()), float(b.numbers.mean())),
        difference=relative_difference(a.numbers, b.numbers),
        p=p,
        distance=distance,
        needed=runs_needed(a.numbers, b.numbers, LIMIT),
    )


def as_mapping(row: Row) -> dict[str, Any]:
    """The row for JSON, verdicts included; what is not a number is null."""
    content = {
        **asdict(row),
        "verdict": row.verdict,
        "inside": row.difference.inside(LIMIT),
    }
    return {name: _plain(value) for name, value in content.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _plain(v) for name, v in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


def comparison_table(rows: Sequence[Row], reference: str, other: str) -> str:
    """The rows as Markdown."""
    head = (
        f"| scene | quantity | grains | runs {reference} / {other} | failed | mean {reference} | "
        f"mean {other} | difference (95 %) | inside ±{LIMIT:.0%} (runs for it) | "
        "p | p, family | verdict |"
    )
    lines = [head, "|---|---|--:|--:|--:|--:|--:|--:|---|--:|--:|---|"]
    for row in rows:
        d = row.difference
        mean = [f"{m:.4g} {row.unit}".removesuffix(" -") for m in row.means]
        within = "" if math.isnan(d.low) else f" ({d.low:+.1%} to {d.high:+.1%})"
        distance = "" if row.distance is None else f", distributions {row.distance:.3f} apart"
        lines.append(
            f"| {row.scene} | {row.quantity} | {row.grains} | {row.runs[0]} / {row.runs[1]} "
            f"| {row.failed[0]} / {row.failed[1]} | {mean[0]} | {mean[1]} "
            f"| {d.estimate:+.1%}{within}{distance} "
            f"| {'yes' if d.inside(LIMIT) else 'no'} ({row.needed or '?'}) "
            f"| {row.p:.2g} | {row.p_family:.2g} | {row.verdict} |"
        )
    return "\n".join(lines)


def sample_table(found: Sequence[Sample]) -> str:
    """Means and scatter of single engines as Markdown."""
    lines = [
        "| engine | scene | quantity | grains | runs | failed | mean | scatter | CPU s a run |",
        "|---|---|---|--:|--:|--:|--:|--:|--:|",
    ]
    for s in found:
        mean = f"{s.numbers.mean():.4g} {s.quantity.unit}" if len(s.numbers) else "-"
        lines.append(
            f"| {s.engine} | {s.scene} | {s.quantity.name} | {s.grains} | {len(s.numbers)} "
            f"| {s.failed} | {mean.removesuffix(' -')} | {s.scatter:.1%} | {s.cpu_s:.3g} |"
        )
    return "\n".join(lines)
