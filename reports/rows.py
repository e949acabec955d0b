"""The evaluations of a run, reduced to what tables and curves need."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from mfopt.arrays import Array
from mfopt.campaign.store import RunDirectory
from mfopt.records.evaluation import Evaluation, Purpose
from mfopt.records.objective import Criteria, Objective, value
from mfopt.records.outcome import Status
from reports.plain import plain


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """One evaluation without its raw arrays."""

    index: int
    generation: int  # 0 outside of generations
    level: str
    seed: int
    purpose: Purpose
    x: Array  # (d,) physical units
    value: float  # the study's objective, infinite if the run failed
    quantities: Mapping[str, float]  # what an engineer asks of a run, SI units; by name
    status: Status
    why: str | None
    work: float
    cpu_s: float

    def quantity(self, name: str) -> float:
        """One of the quantities; nan if the run does not give it."""
        return self.quantities.get(name, math.nan)

    @property
    def finished(self) -> bool:
        """Whether the run ended as it should and gave a value."""
        return math.isfinite(self.value)


def read_rows(run: RunDirectory) -> tuple[Row, ...]:
    """Every evaluation of the run, in the order of its journal.

    All values are those of the objective that the run's header names, whatever objective
    ranked them in their generation: so they compare over the whole run.
    """
    criteria = run.criteria
    objective = criteria.objectives.get(str(run.header.get("objective")))
    return tuple(_row(evaluation, objective, criteria) for evaluation in run.evaluations())


def _row(evaluation: Evaluation, objective: Objective | None, criteria: Criteria) -> Row:
    c, o = evaluation.candidate, evaluation.outcome
    known = evaluation.objective if objective is None else value(objective, o)
    return Row(
        c.index, c.generation, plain(c.level), c.seed, c.purpose, c.x, known,
        criteria.quantities_of(o), o.status, o.why and plain(o.why), o.work, o.cpu_s,
    )  # fmt: skip
