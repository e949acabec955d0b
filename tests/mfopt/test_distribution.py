import numpy as np
import pytest

from mfopt.arrays import Array
from mfopt.search.distribution import Distribution


def learnt(seed: int = 1) -> Distribution:
    """A distribution that has met an ellipsoid for some generations."""
    distribution = Distribution(np.full(4, 0.5), 0.1, 10, np.random.default_rng(seed))
    for _ in range(15):
        z = distribution.sample(10)
        distribution.update(z, ((z - 0.45) ** 2 @ np.array([1.0, 10.0, 100.0, 1000.0])))
    return distribution


def test_whitening_is_undone() -> None:
    distribution = learnt()
    z = 0.45 + 0.02 * np.random.default_rng(2).normal(size=(20, 4))
    np.testing.assert_allclose(distribution.to_z(distribution.to_u(z)), z, atol=1e-12)


def test_samples_are_standard_normal_in_its_coordinates() -> None:
    distribution = learnt()
    u = distribution.to_u(distribution.sample(4000))
    np.testing.assert_allclose(u.mean(axis=0), 0.0, atol=0.08)
    np.testing.assert_allclose(np.cov(u.T), np.eye(4), atol=0.12)


def test_points_stay_in_the_cube() -> None:
    distribution = Distribution(np.array([0.02, 0.99]), 0.5, 6, np.random.default_rng(3))
    for z in (distribution.sample(200), distribution.to_z(np.full((1, 2), 50.0))):
        assert (z >= 0.0).all()
        assert (z <= 1.0).all()


def test_sampling_leaves_the_coordinates_as_they_are() -> None:
    distribution = learnt()
    point = distribution.mean[None, :] + 0.01
    before = distribution.to_u(point)
    distribution.sample(1)
    np.testing.assert_array_equal(distribution.to_u(point), before)


def test_widening_keeps_the_shape() -> None:
    distribution = learnt()
    point = distribution.mean[None, :] + 0.01
    before, widest = distribution.to_u(point), distribution.widest
    distribution.widen(4.0 * widest)
    assert distribution.widest == pytest.approx(4.0 * widest)
    np.testing.assert_allclose(distribution.to_u(point), before / 4.0, rtol=1e-9)
    distribution.widen(widest)
    assert distribution.widest == pytest.approx(4.0 * widest)


def test_it_moves_to_low_losses_and_repeats() -> None:
    def loss(z: Array) -> float:
        return float((z - 0.45) ** 2 @ np.array([1.0, 10.0, 100.0, 1000.0]))

    assert loss(learnt(1).mean) < 0.05 * loss(np.full(4, 0.5))
    np.testing.assert_array_equal(learnt(1).mean, learnt(1).mean)


def test_few_points_are_folded_back_at_the_walls(monkeypatch: pytest.MonkeyPatch) -> None:
    def spread() -> float:
        wide = Distribution(np.full(2, 0.5), 0.3, 6, np.random.default_rng(1))
        return float(np.std(wide.sample(2000)))

    redrawn = spread()
    monkeypatch.setattr("mfopt.search.distribution.TRIES", 1)
    assert redrawn < 0.95 * spread()


def test_an_optimum_at_the_walls_is_still_sampled() -> None:
    wall = np.zeros(13)
    z = Distribution(wall, 0.1, 11, np.random.default_rng(1)).sample(200)
    assert z.min() >= 0.0
    assert np.median(z) < 0.067  # that of half a normal
