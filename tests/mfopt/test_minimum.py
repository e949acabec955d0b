"""What `minimize` says where it found nothing."""

import math

from mfopt.arrays import frozen
from mfopt.records.evaluation import Candidate, Evaluation
from mfopt.records.outcome import Outcome, Status
from mfopt.study.minimum import why_nothing

X = frozen([0.0])


def run(level: str, why: str | None) -> Evaluation:
    status: Status = "finished" if why is None else "crashed"
    outcome = Outcome(X, level, 1, status, why, {})
    return Evaluation(Candidate(0, X, level, 1), outcome, math.inf if why else 1.0)


def test_failed_runs_at_the_target_are_counted_alone() -> None:
    runs = [run("coarse", "no licence"), run("fine", "no memory"), run("fine", "no memory")]
    said = why_nothing(runs, "fine")
    assert said == "no run at level 'fine' finished; 2 of 2 failed with: no memory"


def test_failed_runs_at_other_levels_are_not_said_to_be_of_the_target() -> None:
    runs = [run("coarse", "no licence"), run("coarse", None)]
    said = why_nothing(runs, "fine")
    assert said == (
        "no run was made at level 'fine'; 1 of 2 at other levels failed with: no licence"
    )


def test_without_any_failure_the_budget_was_too_small() -> None:
    said = why_nothing([run("coarse", None)], "fine")
    assert said == "no run was made at level 'fine'; raise the budget"
