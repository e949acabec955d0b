import numpy as np
import pytest

from mfopt.archive import Archive


def test_runs_are_kept_in_order_and_read_only() -> None:
    its = Archive.empty(2)
    assert len(its) == 0
    its = its.added(np.array([0.1, 0.2]), 0, 3.0, np.array([1.0]))
    more = its.added(np.array([0.3, 0.4]), 1, np.inf, np.array([0.0]))
    assert (len(its), len(more), more.finished) == (1, 2, 1)
    np.testing.assert_array_equal(more.z, [[0.1, 0.2], [0.3, 0.4]])
    np.testing.assert_array_equal(more.counts, [[1.0], [0.0]])
    np.testing.assert_array_equal(more.values_at(1), [np.inf])
    with pytest.raises(ValueError, match="read-only"):
        more.z[0, 0] = 5.0
