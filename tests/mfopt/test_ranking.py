import numpy as np
import pytest

from mfopt.search.ranking import certainty, expected_weights, recombination_weights


def test_weights_are_those_of_the_tutorial() -> None:
    # Hansen, arXiv:1604.00772, eq. 49 for lambda = 6: ln 3.5 - ln i.
    raw = np.log(3.5) - np.log(np.arange(1, 7))
    expected = np.where(raw > 0, raw / raw[:3].sum(), raw / -raw[3:].sum())
    np.testing.assert_allclose(recombination_weights(6), expected, rtol=1e-12)


def test_a_certain_ranking_expects_its_own_weights() -> None:
    values = np.array([3.0, 1.0, 2.0, 5.0, 4.0])
    weights = expected_weights(np.tile(values, (10, 1)))
    np.testing.assert_allclose(weights, recombination_weights(5)[[2, 0, 1, 4, 3]])
    assert certainty(weights) == pytest.approx(1.0)


def test_a_ranking_by_chance_is_not_certain() -> None:
    draws = np.random.default_rng(1).normal(size=(4000, 10))
    weights = expected_weights(draws)
    np.testing.assert_allclose(weights, 0.0, atol=0.03)
    assert certainty(weights) < 0.01


def test_expected_weights_do_not_depend_on_a_monotone_scale() -> None:
    draws = np.random.default_rng(2).normal(size=(50, 8))
    np.testing.assert_array_equal(expected_weights(draws), expected_weights(np.exp(draws)))
