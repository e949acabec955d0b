"""Effects that a sum of processes learns one by one add up, and vanish at zero strength."""

import numpy as np
import pytest

from mfopt.arrays import Array
from surrogates.effects import NONE, EffectProcesses, Runs, _loss, fit_effects, pinned

NOISE = 0.03


def base(z: Array) -> Array:
    return np.asarray(np.sin(2.0 * z[:, 0]) + z[:, 1] ** 2)


def added(effect: int, z: Array, s: Array) -> Array:
    return np.asarray((0.3, -0.5)[effect] * s * (1.0 + 0.5 * z[:, effect]))


@pytest.fixture(scope="module")
def fitted() -> EffectProcesses:
    rng = np.random.default_rng(1)
    effect = np.repeat([NONE, 0, 1], [30, 25, 25])
    z, s = rng.random((80, 2)), np.where(effect == NONE, 0.0, rng.random(80))
    y = base(z) + NOISE * rng.standard_normal(80)
    for number in (0, 1):
        y = y + np.where(effect == number, added(number, z, s), 0.0)
    return fit_effects(Runs(z, effect, s), np.column_stack([y, -2.0 * y]))


def test_an_effect_is_learned_beside_the_simulation(fitted: EffectProcesses) -> None:
    rng = np.random.default_rng(2)
    z, s = rng.random((60, 2)), rng.random((60, 1))
    for number in (0, 1):
        mean, variance = fitted.having([number]).predict(np.hstack([z, s]))
        error = mean[:, 0] - base(z) - added(number, z, s[:, 0])
        assert np.sqrt(np.mean(error**2)) < NOISE
        assert np.mean(error**2 / variance[:, 0]) < 3.0


def test_effects_together_add_up(fitted: EffectProcesses) -> None:
    rng = np.random.default_rng(3)
    z, s = rng.random((20, 2)), rng.random((20, 2))
    none, first, second, both = (
        fitted.having(which).predict(np.hstack([z, s[:, which]]))[0]
        for which in ([], [0], [1], [0, 1])
    )
    assert both - none == pytest.approx(first - none + second - none)


def test_an_effect_of_no_strength_is_none(fitted: EffectProcesses) -> None:
    z = np.random.default_rng(4).random((10, 2))
    none = fitted.predict(z)
    with_it = fitted.having([1]).predict(np.hstack([z, np.zeros((10, 1))]))
    assert with_it[0] == pytest.approx(none[0], abs=1e-9)
    assert with_it[1] == pytest.approx(none[1], abs=1e-9)


def test_the_mean_alone_is_that_of_the_prediction(fitted: EffectProcesses) -> None:
    points = np.random.default_rng(5).random((7, 3))
    its = fitted.having([0])
    assert its.mean_at(points) == pytest.approx(its.predict(points)[0])


def test_a_pinned_process_vanishes_at_zero_and_has_unit_variance_at_full_strength() -> None:
    s = np.array([-1.0, -0.4, 0.0, 0.7, 1.0])
    covariance = pinned(s, s)
    assert covariance[2] == pytest.approx(np.zeros(5), abs=1e-12)
    assert covariance[4, 4] == pytest.approx(1.0)
    assert covariance[0, 0] == pytest.approx(1.0)
    assert np.linalg.eigvalsh(covariance).min() > -1e-12


def test_the_gradient_of_the_likelihood_is_that_of_differences() -> None:
    rng = np.random.default_rng(6)
    effect = np.repeat([NONE, 0, 1], 8)
    runs = Runs(rng.random((24, 2)), effect, np.where(effect == NONE, 0.0, rng.random(24)))
    loss = _loss(runs, rng.standard_normal(24), 2)
    at = np.log(np.array([0.8, 0.2, 0.5, 0.9, 0.3, 0.6]))
    _, gradient = loss(at)
    step = 1e-5
    for i in range(len(at)):
        apart = np.eye(len(at))[i] * step
        slope = (loss(at + apart)[0] - loss(at - apart)[0]) / (2.0 * step)
        assert gradient[i] == pytest.approx(slope, rel=1e-4, abs=1e-6)
