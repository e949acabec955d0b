"""The evaluations of a run, reduced to what tables and curves need."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mfopt.arrays import AnyArray, Array
from mfopt.evaluation import Evaluation, Purpose
from mfopt.objective import Objective, ObjectiveSettings, objective_named, value
from mfopt.outcome import Status
from mfopt.store import RunDirectory
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
    filling_time: float  # [s] first to last grain; nan if it does not apply
    left_in_cup: float  # grains; nan if it does not apply
    left_in_hopper: float
    status: Status
    why: str | None
    work: float
    cpu_s: float

    @property
    def finished(self) -> bool:
        """Whether the run ended as it should and gave a value."""
        return math.isfinite(self.value)


def read_rows(run: RunDirectory) -> tuple[Row, ...]:
    """Every evaluation of the run, in the order of its journal.

    All values are those of the objective that the run's header names, whatever objective
    ranked them in their generation: so they compare over the whole run.
    """
    settings = ObjectiveSettings(**run.header.get("objective_settings", {}))
    objective = objective_named(run.header["objective"], settings)
    return tuple(_row(evaluation, objective) for evaluation in run.evaluations())


def _row(evaluation: Evaluation, objective: Objective) -> Row:
    c, o = evaluation.candidate, evaluation.outcome
    return Row(
        c.index, c.generation, plain(c.level), c.seed, c.purpose, c.x,
        value(objective, evaluation.outcome),
        filling_time(o.raw) if o.finished else math.nan,
        _count(o.raw, "left_in_cup"), _count(o.raw, "left_in_hopper"),
        o.status, o.why and plain(o.why), o.work, o.cpu_s,
    )  # fmt: skip


def filling_time(raw: Mapping[str, AnyArray]) -> float:
    """Time between the first and the last grain [s]; nan if no grains are recorded."""
    times = raw.get("passage_times", np.empty(0))
    return float(times.max() - times.min()) if times.size > 2 else math.nan


def _count(raw: Mapping[str, AnyArray], name: str) -> float:
    return float(raw[name]) if name in raw else math.nan
