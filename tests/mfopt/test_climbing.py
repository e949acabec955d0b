from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from mfopt.search.archive import Archive
from mfopt.search.climbing import Standing, misled, validation_due, why_climb


def archive(above: Sequence[float]) -> Archive:
    """Ten runs at level 0, then runs at level 1 with these values."""
    its = Archive.empty(2)
    for k in range(10):
        its = its.added(np.full(2, k / 10), 0, 1, float(k), np.empty(0))
    for value in above:
        its = its.added(np.full(2, (1 + its.finished) / 100), 1, 1, value, np.empty(0))
    return its


def standing(above: Sequence[float]) -> Standing:
    return Standing(0, archive(above), 0.1, widest=0.1, certainty=0.8, certainty_above=0.8)


def test_it_stays_while_validations_improve() -> None:
    assert why_climb(standing([9.0, 5.0, 4.0, 3.0, 2.0, 1.0, 0.5])) is None


def test_it_climbs_when_validations_no_longer_improve() -> None:
    assert why_climb(standing([9.0, 5.0, 5.1, 5.0])) is not None
    assert why_climb(standing([9.0, 5.0, 5.1])) is None  # too few to tell


@pytest.mark.parametrize("change", [{"widest": 1e-3}, {"below_share": 0.7}])
def test_it_climbs_when_converged_or_when_the_share_is_spent(change: dict[str, float]) -> None:
    assert why_climb(standing([])) is None
    assert why_climb(replace(standing([]), **change)) is not None  # type: ignore[arg-type]


def test_doubt_at_the_next_level_counts_once_there_are_enough_validations() -> None:
    doubtful = {"certainty_above": 0.1}
    few, enough = [6.0, 5.0, 4.0], [9.0, 8.0, 7.0, 6.0, 5.0, 4.0]
    assert why_climb(replace(standing(few), **doubtful)) is None
    assert why_climb(replace(standing(enough), **doubtful)) is not None


def test_a_validation_is_due_by_cost_or_by_runs() -> None:
    assert not validation_due(15.0, 15, 8.0)
    assert validation_due(16.0, 16, 8.0)
    assert validation_due(0.4, 40, 1000.0)


def test_a_level_misleads_if_nothing_it_finds_beats_the_start() -> None:
    runs = archive([3.0, 1.0, 2.0])
    found = [misled(runs, start, 1) for start in runs.designs_at(1)]
    assert found == [False, True, False]  # whichever of them was told first
    alone = archive([1.0])
    assert not misled(alone, alone.designs_at(1)[0], 1)
    assert not misled(archive([]), np.zeros(2), 1)


def test_it_climbs_as_soon_as_two_validations_are_worse_than_the_start() -> None:
    assert why_climb(standing([1.0, 2.0])) is None
    assert why_climb(standing([1.0, 2.0, 3.0])) is not None
