"""The numbers at the end of a run, against the run itself."""

import json
import re
from collections.abc import Callable

import numpy as np
import pytest

from mfopt.campaign.store import RunDirectory
from mfopt.records.evaluation import Reference
from reports.answer import answer, as_text


def test_the_reference_is_named_beside_the_target(finished_run: RunDirectory) -> None:
    its = answer(finished_run)
    *_, best, baseline = finished_run.evaluations()
    assert its["level"] == "yade-1000"  # no level of the reference
    assert its["reference"]["engine"] == "longdouble 2022.01a"
    assert its["reference"]["best"] == pytest.approx(best.objective)
    assert its["reference"]["baseline"] == pytest.approx(baseline.objective)
    at_target = {
        e.candidate.purpose: e.objective
        for e in finished_run.evaluations()
        if e.candidate.seed == best.candidate.seed
    }
    assert its["reference"]["best_at_target"] == pytest.approx(at_target["confirm best"])
    assert its["reference"]["baseline_at_target"] == pytest.approx(at_target["confirm baseline"])


def test_the_reference_changes_no_median(finished_run: RunDirectory) -> None:
    confirmed = [
        e.objective for e in finished_run.evaluations() if e.candidate.purpose == "confirm best"
    ]
    assert answer(finished_run)["confirmed_median"] == pytest.approx(np.median(confirmed))


def test_a_run_at_its_beginning_has_an_answer(make_run: Callable[..., RunDirectory]) -> None:
    run = make_run(generations=0, finished=False)
    run.add_reference(Reference(why_not="yade is not installed"))
    its = answer(run)
    assert "objective" not in its
    assert its["reference"] == {"skipped": "yade is not installed"}
    assert json.loads(json.dumps(its, allow_nan=False)) == its


def test_without_a_reference_none_is_named(own_run: RunDirectory) -> None:
    assert "reference" not in answer(own_run)


@pytest.mark.parametrize("run", ["finished_run", "own_run"])
def test_the_text_fits_the_smallest_terminal_and_ascii(
    run: str, request: pytest.FixtureRequest
) -> None:
    text = as_text(request.getfixturevalue(run))
    assert max(map(len, text.splitlines())) <= 80
    assert text.encode("ascii", errors="strict")


def test_the_text_has_units_and_tells_search_confirmation_and_reference_apart(
    finished_run: RunDirectory,
) -> None:
    text = " ".join(as_text(finished_run).split())
    for words in (
        "filling time [ms] at most 330, best ", "mass left [%] best 0, baseline 0.2",
        "ABOVE THE LIMIT IN 5 OF 5 RUNS", "cost: search ", "cost: confirmation 10.0",
        "cost: reference 66.7 full runs, 5.00 CPU h in 2 runs", "below the baseline's",
    ):  # fmt: skip
        assert words in text, words
    assert re.search(r"best design l1 \d+\.\d mm, ", text)


def test_numbers_for_scripts_have_their_units(finished_run: RunDirectory) -> None:
    its = answer(finished_run)
    filling = its["needs"]["filling time"]
    assert (filling["unit"], filling["limit"]) == ("s", 0.33)
    assert filling["best"]["low"] <= filling["best"]["median"] <= filling["best"]["high"]
    assert its["cost"]["confirmation"] == pytest.approx(
        {"full_runs": 10.0, "cpu_s": 3000.0, "runs": 10, "failed": 0}
    )
