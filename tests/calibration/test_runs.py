"""Runs beside recordings: failed ones are counted by their reason."""

import numpy as np
import pytest

from calibration.recordings.records import Recording, Repeat
from calibration.runs import finished
from mfopt.errors import SimulationError
from mfopt.records.evaluation import Candidate, Evaluation
from mfopt.records.outcome import Outcome

HEAP = Recording("heap", {}, (Repeat("", {}, {"angle": 0.4}),))


def run(why: str | None) -> Evaluation:
    x = np.zeros(1)
    raw = {"angle": np.array(0.4)} if why is None else {}
    outcome = Outcome(x, "heap", 1, "finished" if why is None else "crashed", why, raw)
    return Evaluation(Candidate(0, x, "heap", 1, 0, "design"), outcome, 0.0)


@pytest.mark.parametrize(
    ("reasons", "said"),
    [
        (["late", "nan:\n1", "nan:\n2", "full"],
         "The most frequent reason, of 2 runs: nan:\n2"),
        (["late", "late", None], "The reason of all: late"),
        (["late"], "The reason of this: late"),
    ],
)  # fmt: skip
def test_most_failed_runs_are_told_by_the_most_frequent_reason(
    reasons: list[str | None], said: str
) -> None:
    failed = sum(why is not None for why in reasons)
    with pytest.raises(SimulationError, match=f"{failed} of {len(reasons)} runs failed") as told:
        finished(list(map(run, reasons)), HEAP)
    assert str(told.value).endswith(said)


def test_half_of_the_runs_are_enough() -> None:
    assert len(finished([run(None), run("late")], HEAP)) == 1
