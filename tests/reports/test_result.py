"""Which design is the best one, and how it is compared."""

import math
from typing import Any

import numpy as np
import pytest

from mfopt.records.evaluation import Insight
from mfopt.records.objective import Quantity
from reports.result import best_at, compare, result, solutions, typical_first
from reports.rows import Row
from reports.sentence import sentence
from reports.units import Display

LEVELS = ["coarse", "fine"]


def row(index: int, value: float, **given: Any) -> Row:
    fields: dict[str, Any] = {
        "index": index, "generation": 1, "level": "coarse", "seed": 1, "purpose": "search",
        "x": np.array([float(index)]), "value": value, "quantities": {"filling time": 2.0 * value},
        "status": "finished", "why": None, "work": 1.0, "cpu_s": 1.0,
    }  # fmt: skip
    return Row(**(fields | given))


def test_the_finest_level_decides_although_a_coarse_value_is_lower() -> None:
    rows = [row(0, 0.1), row(1, 0.9, level="fine"), row(2, 0.7, level="fine")]
    found = result(rows, LEVELS)
    assert found is not None
    assert found.found.index == 2
    assert [r.index for r in solutions(rows, LEVELS, 3)] == [2, 1, 0]


def test_the_same_design_is_listed_once_with_its_best_value() -> None:
    x = np.array([3.0])
    rows = [row(0, 0.5, x=x), row(1, 0.4, x=x), row(2, 0.6)]
    assert [r.index for r in solutions(rows, LEVELS)] == [1, 2]


def test_finalists_are_among_the_best_designs_and_the_winner_is_the_first() -> None:
    rows = [
        row(0, 0.1), row(1, 0.2), row(2, 0.6, x=np.array([0.0]), level="fine", purpose="finalist"),
        row(3, 0.7, x=np.array([1.0]), level="fine", purpose="finalist"),
    ]  # fmt: skip
    assert [r.index for r in solutions(rows, LEVELS, chosen_x=np.array([1.0]))] == [3, 2]


def test_failed_runs_are_never_best() -> None:
    rows = [row(0, math.inf, status="crashed"), row(1, 0.5)]
    assert [r.index for r in solutions(rows, LEVELS)] == [1]
    assert result(rows[:1], LEVELS) is None
    assert best_at(rows[:1], "coarse") is None
    np.testing.assert_array_equal(best_at(rows, "coarse"), rows[1].x)


def test_confirmation_pairs_by_seed_and_leaves_unpaired_seeds_out() -> None:
    best = [row(i, v, seed=s, purpose="confirm best", x=np.array([7.0]))
            for i, (s, v) in enumerate([(11, 0.2), (12, 0.3), (13, 0.4)])]  # fmt: skip
    base = [row(5 + i, v, seed=s, purpose="confirm baseline")
            for i, (s, v) in enumerate([(13, 1.0), (12, 0.8), (14, 9.0)])]  # fmt: skip
    found = result([row(9, 0.01, x=np.array([7.0])), *best, *base], LEVELS)
    assert found is not None
    assert found.objective is not None
    assert found.objective.seeds == (12, 13)
    np.testing.assert_array_equal(found.objective.best, [0.3, 0.4])
    np.testing.assert_array_equal(found.objective.baseline, [0.8, 1.0])
    assert found.found.index == 9  # the search's run of the same design
    assert found.typical.value == 0.3  # the median of its three
    assert found.quantities["filling time"].reduction == pytest.approx(100.0 * (1.0 - 0.35 / 0.9))


def test_a_quantity_that_does_not_apply_is_not_compared() -> None:
    a, b = row(0, 0.5, quantities={}), row(1, 0.6, quantities={})
    assert compare([a], [b], lambda r: r.quantity("filling time")) is None
    assert compare([a], [row(2, 0.6, seed=2)], lambda r: r.value) is None  # no common seed


def test_the_typical_first_design_is_the_median_of_its_generation() -> None:
    rows = [row(i, v) for i, v in enumerate([5.0, 1.0, 3.0])] + [row(9, 2.0, generation=2)]
    typical = typical_first(rows)
    assert typical is not None
    assert typical.value == 3.0


def test_nothing_is_believed_of_a_level_without_a_finished_run() -> None:
    x = np.array([3.0])
    rows = [row(0, 0.5, x=x), row(1, math.inf, x=x, level="fine", status="crashed")]
    insights = [
        Insight(number, 1.0, 1, level, (3.0,), 0.4, 0.1)
        for number, level in enumerate(["coarse", "fine"], start=1)
    ]
    found = result(rows, LEVELS, insights)
    assert found is not None
    assert found.belief is insights[0]
    found = result([*rows, row(2, 0.6, x=x, level="fine")], LEVELS, insights)
    assert found is not None
    assert found.belief is insights[1]


def test_the_sentence_tells_every_quantity_of_both_designs() -> None:
    left = Quantity("mass left", "-", lambda raw: float(raw["left"]), (1e2, "%"))
    best = row(0, 0.2, purpose="confirm best", quantities={"mass left": 0.01})
    base = row(1, 0.4, purpose="confirm baseline", quantities={"mass left": 0.2})
    rows = [row(2, 0.1, x=best.x), best, base]
    its = result(rows, LEVELS)
    text = sentence(its, rows, "dispersion", Display(1.0, "s"), (left,), ended=True)
    assert text.endswith("; mass left 1.00\u202f% instead of 20.0\u202f%.")
