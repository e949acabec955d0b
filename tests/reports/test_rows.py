"""Evaluations reduced to rows."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mfopt.arrays import frozen
from mfopt.evaluation import Candidate, Evaluation, Generation
from mfopt.objective import objective_named, value
from mfopt.outcome import Outcome
from mfopt.store import RunDirectory, create
from reports.rows import filling_time, read_rows


def test_filling_time_is_from_first_to_last_grain() -> None:
    assert filling_time({"passage_times": np.array([0.3, 0.5, 0.75])}) == pytest.approx(0.45)
    assert math.isnan(filling_time({"f": np.array(1.0)}))


def test_values_are_those_of_the_study_objective_whatever_ranked_the_generation(
    tmp_path: Path,
) -> None:
    raw = {"passage_times": np.linspace(0.2, 0.6, 101), "left_in_cup": np.array(2),
           "left_in_hopper": np.array(0), "grains": np.array(4600),
           "duration": np.array(1.0)}  # fmt: skip
    run = create(tmp_path, "", {"objective": "filling_time", "levels": []})
    run.add_generation(Generation(1, "a", 0, 0.2, 4, "dispersion"))
    out = Outcome(frozen([1.0]), "a", 1, "finished", None, raw)
    told = value(objective_named("dispersion"), out)
    run.add_evaluation(Evaluation(Candidate(0, out.x, "a", 1, 1), out, told))
    (row,) = read_rows(run)
    assert row.value == pytest.approx(0.4 + 2 * 0.05)
    assert row.left_in_cup == 2


def test_rows_agree_with_the_journal(make_run: Callable[..., RunDirectory]) -> None:
    run = make_run(generations=2, finished=False)
    for row, evaluation in zip(read_rows(run), run.evaluations(), strict=True):
        assert row.value == evaluation.objective
        assert row.finished == evaluation.outcome.finished
