import numpy as np

from mfopt.arrays import capped


def test_values_beyond_the_limit_count_as_that_and_failed_runs_stay_failed() -> None:
    values = [1.0, 1e30, 1.7e308, -1e200, 5e-324, np.inf]
    np.testing.assert_array_equal(capped(values), [1.0, 1e30, 1e50, -1e50, 5e-324, np.inf])
    assert np.isnan(capped(np.nan))
