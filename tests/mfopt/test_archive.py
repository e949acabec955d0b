import numpy as np
import pytest

from mfopt.search.archive import Archive


def test_runs_are_kept_in_order_and_read_only() -> None:
    its = Archive.empty(2)
    assert len(its) == 0
    its = its.added(np.array([0.1, 0.2]), 0, 1, 3.0, np.array([1.0]))
    more = its.added(np.array([0.3, 0.4]), 1, 1, np.inf, np.array([0.0]))
    assert (len(its), len(more), more.finished) == (1, 2, 1)
    np.testing.assert_array_equal(more.z, [[0.1, 0.2], [0.3, 0.4]])
    np.testing.assert_array_equal(more.counts, [[1.0], [0.0]])
    np.testing.assert_array_equal(more.values_at(1), [np.inf])
    with pytest.raises(ValueError, match="read-only"):
        more.z[0, 0] = 5.0


def test_an_archive_does_not_see_what_is_added_to_it() -> None:
    one = Archive.empty(1).added(np.array([0.1]), 0, 1, 1.0, np.array([0.0]))
    left, right = (one.added(np.array([z]), 0, 1, z, np.array([z])) for z in (0.2, 0.3))
    assert (one.z.tolist(), left.z.tolist(), right.z.tolist()) == (
        [[0.1]], [[0.1], [0.2]], [[0.1], [0.3]],
    )  # fmt: skip
    assert left.added(np.array([0.4]), 0, 1, 4.0, np.array([0.0])).value.tolist() == [1.0, 0.2, 4.0]


def test_rows_are_copied_only_where_their_number_has_doubled() -> None:
    its, copies, n = Archive.empty(2), 0, 4000
    for number in range(n):
        before, its = its, its.added(np.zeros(2), 0, 1, float(number), np.zeros(1))
        copies += not np.shares_memory(before.value, its.value)
    assert copies < 2 + np.log2(n)
    np.testing.assert_array_equal(its.value, np.arange(n))


A, B = np.array([0.1, 0.2]), np.array([0.3, 0.4])


@pytest.mark.parametrize(
    ("runs", "scatter"),
    [
        ([], None),
        ([(A, 0, 1, 2.0), (B, 0, 2, 2.0)], None),  # no design twice
        ([(A, 0, 1, 2.0), (A, 0, 1, 2.0)], None),  # twice on one seed tells nothing
        ([(A, 0, 1, 2.0), (A, 1, 2, 2.0)], None),  # another level
        ([(A, 0, 1, 2.0), (A, 0, 2, np.inf)], None),  # failed
        ([(A, 0, 1, 2.0), (B, 0, 1, 3.0), (A, 0, 2, 2.0)], False),
        ([(A, 0, 1, 2.0), (A, 0, 2, 2.0), (B, 0, 1, 3.0), (B, 0, 2, 3.5)], True),
    ],
)
def test_scatter_is_known_where_a_design_ran_on_other_seeds(
    runs: list[tuple[np.ndarray, int, int, float]], scatter: bool | None
) -> None:
    its = Archive.empty(2)
    for z, level, seed, value in runs:
        its = its.added(z, level, seed, value, np.empty(0))
    assert its.scatter(0) is scatter
