"""How discharges are judged, against runs made by hand."""

import numpy as np
import pytest

from fidelity.scenes.discharge.objectives import Wanted, criteria
from mfopt.arrays import AnyArray, frozen
from mfopt.records.objective import value
from mfopt.records.outcome import Outcome

DURATION = 2.5  # [s]


def run(times: list[float], left: int) -> Outcome:
    raw: dict[str, AnyArray] = {
        "passage_times": np.array(times),
        "mass_flow_rate": np.asarray(0.1),
        "left": np.asarray(left),
        "grains": np.asarray(len(times) + left),
        "duration": np.asarray(DURATION),
    }
    return Outcome(frozen([30.0]), "l", 1, "finished", None, raw)


JUDGED = criteria(Wanted())


def test_a_hopper_that_empties_has_the_time_of_its_last_grain() -> None:
    assert JUDGED.quantities_of(run([0.2, 0.9, 0.5, 0.7], left=1))["discharge time"] == 0.9


@pytest.mark.parametrize("times", [[], [0.05, 0.1]])
def test_a_hopper_that_keeps_most_grains_has_no_discharge_time(times: list[float]) -> None:
    found = JUDGED.quantities_of(run(times, left=8))
    assert "discharge time" not in found
    assert found["mass left"] == 8 / (8 + len(times))


def test_a_blocked_hopper_is_worse_than_one_that_empties_slowly() -> None:
    objective = JUDGED.objective("discharge_time")
    blocked, slow = run([0.05], left=9), run([0.1 * n for n in range(1, 20)], left=0)
    assert value(objective, blocked) == pytest.approx(DURATION + 0.9)
    assert value(objective, slow) == pytest.approx(1.9)
