"""Evaluations reduced to rows."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fidelity.scenes.dosing.objectives import criteria, filling_time
from mfopt.arrays import AnyArray, Array, frozen
from mfopt.campaign.store import RunDirectory, create
from mfopt.records.evaluation import Candidate, Evaluation, Generation
from mfopt.records.objective import OWN, value
from mfopt.records.outcome import Outcome
from reports.rows import Row, read_rows

CRITERIA = replace(criteria(), objectives={**criteria().objectives, **OWN.objectives})


def raw(**other: Array) -> dict[str, AnyArray]:
    """A dosing run of 200 grains, 2 of which stay in the cup."""
    made = {
        "passage_times": np.linspace(0.2, 0.6, 198),
        "left_in_cup": np.array(2),
        "left_in_hopper": np.array(0),
        "grains": np.array(200),
        "duration": np.array(1.0),
    }
    return made | other  # fmt: skip


def row(tmp_path: Path, arrays: dict[str, AnyArray], objective: str = "filling_time") -> Row:
    """The only evaluation of a run, which was ranked by another objective if it is of dosing."""
    run = create(tmp_path, "", {"objective": objective, "levels": []}, CRITERIA)
    ranked_by = "dispersion" if objective == "filling_time" else objective
    run.add_generation(Generation(1, "a", 0, 0.2, 4, ranked_by))
    out = Outcome(frozen([1.0]), "a", 1, "finished", None, arrays)
    told = value(CRITERIA.objective(ranked_by), out)
    run.add_evaluation(Evaluation(Candidate(0, out.x, "a", 1, 1), out, told))
    return read_rows(run)[0]


def test_what_is_asked_of_a_dosing_run_stands_in_its_row(tmp_path: Path) -> None:
    its = row(tmp_path, raw())
    assert its.quantity("filling time") == pytest.approx(0.4)
    assert its.quantity("mass left") == pytest.approx(0.01)
    assert 0.1 < its.quantity("dispersion") < 0.12  # 0.4 / sqrt(12), the last grains left out


def test_values_are_those_of_the_study_objective_whatever_ranked_the_generation(
    tmp_path: Path,
) -> None:
    arrays = raw()
    assert row(tmp_path, arrays).value == pytest.approx(sum(filling_time(arrays).values()))


def test_a_run_of_another_kind_has_no_filling_time(tmp_path: Path) -> None:
    its = row(tmp_path, {"f": np.array(3.0)}, "returned")
    assert its.value == 3.0
    assert math.isnan(its.quantity("filling time"))
    assert its.quantities == {}


@pytest.mark.parametrize("odd", [np.array([]), np.array([1.0, 2.0]), np.array(0.0)])
def test_arrays_of_a_user_with_the_same_names_do_no_harm(tmp_path: Path, odd: Array) -> None:
    its = row(tmp_path, {"f": np.array(3.0), **raw(grains=odd, left_in_cup=odd)}, "returned")
    assert its.value == 3.0
    assert math.isnan(its.quantity("mass left"))


def test_rows_agree_with_the_journal(make_run: Callable[..., RunDirectory]) -> None:
    run = make_run(generations=2, finished=False)
    for row, evaluation in zip(read_rows(run), run.evaluations(), strict=True):
        assert row.value == evaluation.objective
        assert row.finished == evaluation.outcome.finished
