from typing import cast

import numpy as np
import pytest

from mfopt.arrays import Array
from mfopt.search.prescreen import blurred, minimiser, thompson
from mfopt.search.surrogate import Observations, Posterior
from surrogates.autoregressive import AutoregressiveGp

BOTTOM = np.array([0.6, -0.3, 0.2])


def taught(noise: float = 0.0, n: int = 40) -> Posterior:
    rng = np.random.default_rng(1)
    z = rng.normal(size=(n, 3))
    value = ((z - BOTTOM) ** 2).sum(axis=1) + noise * rng.standard_normal(n)
    nothing = np.zeros((n, 0))
    return AutoregressiveGp().fit(Observations(z, np.zeros(n, dtype=np.int64), value, nothing))


@pytest.fixture(scope="module")
def bowl() -> Posterior:
    return taught()


def starts() -> Array:
    return np.random.default_rng(2).normal(size=(5, 3))


def test_the_minimiser_of_a_bowl_is_its_bottom(bowl: Posterior) -> None:
    np.testing.assert_allclose(minimiser(bowl, 0, starts(), 3.0), BOTTOM, atol=0.02)


def test_the_trust_region_bounds_it(bowl: Posterior) -> None:
    found = minimiser(bowl, 0, starts(), 0.3)
    assert np.linalg.norm(found) == pytest.approx(0.3, abs=0.03)
    np.testing.assert_allclose(found / np.linalg.norm(found), BOTTOM / 0.7, atol=0.1)


class Slope:
    """A mean that falls along the first axis, and a doubt that grows faster."""

    def __init__(self, noise: float) -> None:
        self.noise = noise

    def latent(self, z: Array, level: int) -> tuple[Array, Array]:
        return -0.1 * z[:, 0], (0.05 * (z**2).sum(axis=1)) ** 2

    def latent_gradient(self, z: Array, level: int) -> tuple[Array, Array]:
        return -0.1 * z[:, 0], np.tile([-0.1, 0.0, 0.0], (len(z), 1))

    def noise_variance(self, level: int) -> float:
        return self.noise


@pytest.mark.parametrize(("noise", "how_far"), [(1e6, 1.0), (0.0, 4.0)])
def test_under_noise_a_minimum_in_the_unknown_is_not_gone_to(noise: float, how_far: float) -> None:
    found = minimiser(cast(Posterior, Slope(noise)), 0, starts(), 4.0)
    np.testing.assert_allclose(found, [how_far, 0.0, 0.0], atol=0.25)


def test_each_draw_chooses_its_best_open_candidate() -> None:
    draws = np.array([[0.0, 1.0, 2.0, 3.0], [0.5, 9.0, 8.0, 7.0], [4.0, 3.0, 2.0, 1.0]])
    assert thompson(draws, [0], 3) == [1, 3, 2]
    assert thompson(draws, [0, 1, 2, 3], 1) == []


def test_thompson_prefers_doubt_over_a_slightly_better_mean() -> None:
    rng = np.random.default_rng(3)
    draws = rng.normal([0.0, 0.1], [0.01, 1.0], size=(500, 2))
    chosen = [thompson(draw[None, :], [], 1)[0] for draw in draws]
    assert 0.35 < np.mean(chosen) < 0.55


def test_noise_blurs_candidates_that_differ_less_than_runs_scatter() -> None:
    noisy, rng = taught(noise=0.5, n=100), np.random.default_rng(4)
    candidates = rng.normal(size=(10, 3))
    for width, expected in ((0.1, True), (3.0, False)):  # they differ by about 0.06 and 30
        draws = noisy.sample(width * candidates, 0, 64, rng)
        assert blurred(noisy, 0, draws) is expected


def test_without_noise_nothing_is_blurred(bowl: Posterior) -> None:
    rng = np.random.default_rng(4)
    close = BOTTOM + 0.05 * rng.normal(size=(10, 3))
    assert not blurred(bowl, 0, bowl.sample(close, 0, 64, rng))
