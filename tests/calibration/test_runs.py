"""Runs beside recordings: failed ones are counted by their reason."""

import numpy as np
import pytest

from calibration.campaign import runs_of_each
from calibration.recordings.case import Case, Measurement, Parameter
from calibration.recordings.records import Recording, Repeat
from calibration.runs import finished, predictions_of_each
from mfopt.errors import ConfigError, SimulationError
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


def case_of(fitted: int, held_out: int) -> Case:
    kinds = [False] * fitted + [True] * held_out
    recordings = tuple(
        Recording(f"heap {n}", {}, HEAP.repeats, held_out) for n, held_out in enumerate(kinds)
    )
    return Case("heaps", 1, {}, (Parameter("friction", 0.1, 0.8),), Measurement(), recordings)


@pytest.mark.parametrize(
    ("fitted", "held_out", "least", "said"),
    [(1, 0, 21, "for 1 fitted recording and"), (2, 0, 42, "for 2 fitted recordings and"),
     (1, 2, 25, "for 1 fitted recording and"), (3, 0, 63, "for 3 fitted recordings and")],
)  # fmt: skip
def test_the_fewest_runs_of_a_calibration_are_those_of_the_docs(
    fitted: int, held_out: int, least: int, said: str
) -> None:
    case = case_of(fitted, held_out)
    assert runs_of_each(case, least) == 16
    with pytest.raises(ConfigError, match=f"{said}.* give at least {least}"):
        runs_of_each(case, least - 1)
    assert 3 <= predictions_of_each(case, least) <= 6
