import math

import numpy as np
import pytest

from mfopt.arrays import AnyArray
from mfopt.records.objective import RETURNED, judged, missed, value
from mfopt.records.outcome import Outcome

X = np.zeros(1)


def test_failed_run_and_nan_are_infinitely_bad() -> None:
    assert value(RETURNED, Outcome(X, "l", 1, "crashed", "why")) == math.inf
    nan = Outcome(X, "l", 1, "finished", raw={"f": np.asarray(math.nan)})
    assert value(RETURNED, nan) == math.inf


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"g": np.asarray(1.0)}, "lacks 'f'"),
        ({"f": np.asarray([1.0, 2.0])}, "cannot be computed"),
        ({"f": np.asarray(math.inf)}, "no finite number"),
    ],
)
def test_a_run_without_its_objective_has_crashed_and_says_why(
    given: dict[str, AnyArray], why: str
) -> None:
    outcome, f = judged(RETURNED, Outcome(X, "l", 1, "finished", raw=given))
    assert (f, outcome.status) == (math.inf, "crashed")
    assert why in (outcome.why or "")
    assert missed(RETURNED, [outcome]).shape == (1, 0)
