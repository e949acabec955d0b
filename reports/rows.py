"""The evaluations of a run, reduced to what tables and curves need."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from mfopt.arrays import AnyArray, Array
from mfopt.campaign.store import RunDirectory
from mfopt.records.evaluation import Evaluation, Purpose
from mfopt.records.objective import Objective, ObjectiveSettings, objective_named, quantities, value
from mfopt.records.outcome import Outcome, Status
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
    dispersion: float  # [s] spread of the passage times; nan if it does not apply
    filling_time: float  # [s] first to last grain; nan if it does not apply
    mass_left: float  # share of the portion that stays behind; nan if it does not apply
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
    return tuple(_row(evaluation, objective, settings) for evaluation in run.evaluations())


def _row(evaluation: Evaluation, objective: Objective, settings: ObjectiveSettings) -> Row:
    c, o = evaluation.candidate, evaluation.outcome
    its = _quantities(o, settings)
    return Row(
        c.index, c.generation, plain(c.level), c.seed, c.purpose, c.x,
        value(objective, evaluation.outcome),
        its.get("dispersion", math.nan), its.get("filling time", math.nan),
        its.get("mass left", math.nan),
        _count(o.raw, "left_in_cup"), _count(o.raw, "left_in_hopper"),
        o.status, o.why and plain(o.why), o.work, o.cpu_s,
    )  # fmt: skip


def _quantities(outcome: Outcome, settings: ObjectiveSettings) -> dict[str, float]:
    """What is asked of a dosing run; nothing of a run that failed or is of another kind."""
    if not outcome.finished:
        return {}
    try:
        return quantities(outcome.raw, settings) or {}
    except (TypeError, ValueError, ArithmeticError):  # a user's arrays of the same names
        return {}


def _count(raw: Mapping[str, AnyArray], name: str) -> float:
    return float(raw[name]) if name in raw and raw[name].ndim == 0 else math.nan
