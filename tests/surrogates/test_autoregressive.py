from collections.abc import Callable

import numpy as np
import pytest
from surrogate_cases import branin, rosenbrock, runs, sphere, waves, wing_weight

from mfopt.arrays import Array
from mfopt.errors import ConfigError
from mfopt.search.prescreen import minimiser
from mfopt.search.surrogate import Observations, Posterior, Surrogate
from surrogates.autoregressive import AutoregressiveGp

SURROGATES = [AutoregressiveGp]
QUANTILE = 1.6449  # of the normal distribution: 90 % lie within
Function = Callable[[Array], Array]


def error(posterior: Posterior, z: Array, truth: Array, level: int) -> float:
    """Root of the mean squared error on the transformed scale, over the spread there."""
    off = posterior.latent(z, level)[0] - posterior.transform(truth)
    return float(np.sqrt(np.mean(off**2)) / posterior.transform(truth).std())


def mixed(seed: int = 9) -> Observations:
    """Three levels of which one has no run, replicates, failures, two soft constraints."""
    rng = np.random.default_rng(seed)
    z = rng.standard_normal((60, 4))
    z[50:] = z[:10]
    counts = np.column_stack([0.05 * np.maximum(0.0, np.round(3.0 * z[:, 0])), np.zeros(60)])
    value = sphere(z) + 0.1 * rng.standard_normal(60) + counts.sum(axis=1)
    value[::9] = np.inf
    return runs(z, value, np.repeat([0, 2, 0], [35, 15, 10]), counts)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_five_runs_of_a_finer_level_correct_most_of_the_coarse_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    z = np.vstack([rng.standard_normal((25, 2)), 0.7 * rng.standard_normal((5, 2))])
    level, moved = np.repeat([0, 1], [25, 5]), np.full(2, np.sqrt(0.5))  # by 1
    value = np.where(level == 0, sphere(z), sphere(z - moved))
    posterior = AutoregressiveGp().fit(runs(z, value, level))
    found = minimiser(posterior, 1, z, radius=3.0)
    assert np.linalg.norm(found - moved) < 0.3


@pytest.mark.parametrize("make", SURROGATES)
@pytest.mark.parametrize(
    "odd",
    [[1e200], [-1e200], [1.7e308, -1.7e308], [5e-324, 0.0], [1e30] * 20, [0.0] * 40, [1e200] * 40],
)
def test_values_of_any_magnitude_give_finite_beliefs(
    make: Callable[[], Surrogate], odd: list[float]
) -> None:
    rng = np.random.default_rng(3)
    z = rng.standard_normal((40, 3))
    value = sphere(z)
    value[rng.permutation(40)[: len(odd)]] = odd
    posterior = make().fit(runs(z, value, np.repeat([0, 1], [30, 10])))
    for level in (0, 1):
        for part in (posterior.predict(z, level), posterior.latent(z, level)):
            assert np.isfinite(part).all()
        assert np.isfinite(posterior.sample(z, level, 50, rng)).all()
        assert np.isfinite(minimiser(posterior, level, z, radius=3.0)).all()


@pytest.mark.parametrize("make", SURROGATES)
@pytest.mark.parametrize("unit", [1e-12, 1e-60, 1e30])
def test_the_unit_of_the_objective_changes_nothing(
    make: Callable[[], Surrogate], unit: float
) -> None:
    z = np.random.default_rng(4).standard_normal((30, 3))
    values = (sphere(z) - 2.0, unit * (sphere(z) - 2.0))
    (mean, variance), (scaled, wider) = (make().fit(runs(z, v)).predict(0.5 * z, 0) for v in values)
    np.testing.assert_allclose(scaled / unit, mean, rtol=1e-3, atol=1e-3)
    np.testing.assert_allclose(np.sqrt(wider) / unit, np.sqrt(variance), rtol=0.1, atol=1e-3)


@pytest.mark.parametrize("make", SURROGATES)
def test_surrogate_protocol(make: Callable[[], Surrogate]) -> None:
    observations, z = mixed(), np.random.default_rng(10).standard_normal((7, 4))
    posterior: Posterior = make().fit(observations)
    for level in (0, 1, 2):
        mean, variance = posterior.predict(z, level)
        latent, latent_variance = posterior.latent(z, level)
        same, gradient = posterior.latent_gradient(z, level)
        draws = posterior.sample(z, level, 4000, np.random.default_rng(11))
        assert mean.shape == variance.shape == latent.shape == latent_variance.shape == (7,)
        assert gradient.shape == (7, 4)
        assert draws.shape == (4000, 7)
        assert (variance > 0.0).all()
        assert (latent_variance > 0.0).all()
        assert posterior.noise_variance(level) > 0.0
        np.testing.assert_allclose(same, latent, rtol=1e-8)
        np.testing.assert_allclose(draws.mean(axis=0), mean, atol=0.1 * draws.std(axis=0).max())
        np.testing.assert_allclose(draws.var(axis=0), variance, rtol=0.2)
        again = posterior.sample(z, level, 4000, np.random.default_rng(11))
        np.testing.assert_array_equal(again, draws)
    values = np.linspace(-10.0, 1e3, 50)
    transformed = posterior.transform(values)
    assert (np.diff(transformed) > 0.0).all()
    np.testing.assert_allclose(posterior.inverse(transformed), values)
    left_out = posterior.left_out()
    kinds = [observations.level, np.isfinite(observations.value), observations.z]
    rows = len(np.unique(np.column_stack(kinds), axis=0))
    assert len(left_out.mean) == len(left_out.observed) == len(left_out.z) == rows
    assert left_out.replicates.sum() == 60


@pytest.mark.parametrize("make", SURROGATES)
def test_hyperparameters_are_kept_or_improved(make: Callable[[], Surrogate]) -> None:
    observations, z = mixed(), np.random.default_rng(10).standard_normal((7, 4))
    posterior = make().fit(observations)
    kept = make().fit(observations, posterior.hyperparameters, refit=False)
    np.testing.assert_array_equal(kept.predict(z, 2), posterior.predict(z, 2))
    warm = make().fit(observations, posterior.hyperparameters)
    spread = np.sqrt(posterior.latent(z, 2)[1])
    assert (np.abs(warm.latent(z, 2)[0] - posterior.latent(z, 2)[0]) < spread).all()
    with pytest.raises(ConfigError, match="pass start"):
        make().fit(observations, refit=False)
    with pytest.raises(ConfigError, match="leave start out"):
        make().fit(runs(observations.z, observations.value), posterior.hyperparameters)


def test_gradient_with_counts_equals_finite_differences() -> None:
    posterior = AutoregressiveGp().fit(mixed())
    z = np.random.default_rng(12).standard_normal((5, 4))
    _, gradient = posterior.latent_gradient(z, 2)
    for j in range(4):
        step = 1e-5 * np.eye(4)[j]
        rise = posterior.latent(z + step, 2)[0] - posterior.latent(z - step, 2)[0]
        np.testing.assert_allclose(gradient[:, j], rise / 2e-5, rtol=1e-4, atol=1e-6)


def covered(
    f: Function, z: Array, held_out: Array, noise: float, rng: np.random.Generator
) -> Array:
    """Whether 90 % intervals hold the noise-free values, then noisy ones, at `held_out`."""
    deviation = noise * float(f(held_out).std())
    posterior = AutoregressiveGp().fit(runs(z, f(z) + deviation * rng.standard_normal(len(z))))
    truth = f(held_out)
    seen = truth + deviation * rng.standard_normal(len(truth))
    mean, variance = posterior.latent(held_out, 0)
    wider = variance + posterior.noise_variance(0)
    return np.array(
        [
            np.abs(posterior.transform(truth) - mean) < QUANTILE * np.sqrt(variance),
            np.abs(posterior.transform(seen) - mean) < QUANTILE * np.sqrt(wider),
        ]
    )


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.5])
def test_intervals_cover_what_they_claim(noise: float) -> None:
    rng = np.random.default_rng(13)
    hits = []
    for _ in range(2):
        few = 60 if noise else 25  # without noise 60 points leave nothing unknown of two inputs
        hits.append(covered(branin, rng.random((few, 2)), rng.random((400, 2)), noise, rng))
        wing = rng.random((80, 10)), rng.random((400, 10))
        hits.append(covered(wing_weight, *wing, noise, rng))
        bowl = rng.standard_normal((90, 6)), rng.standard_normal((400, 6))
        if noise:  # without, the bowl is known to eight digits: nothing to cover
            hits.append(covered(sphere, *bowl, noise, rng))
        hits.append(covered(rosenbrock, *bowl, noise, rng))
    shares = np.concatenate(hits, axis=1).mean(axis=1)
    assert (shares > 0.85).all()
    assert (shares < 0.95).all()


def test_intervals_cover_over_two_levels() -> None:
    rng, hits = np.random.default_rng(14), []
    for _ in range(4):
        z, level = rng.standard_normal((100, 5)), np.repeat([0, 1], [80, 20])
        value = np.where(level == 1, rosenbrock(z), 0.8 * rosenbrock(z) + 5.0 * np.sin(z[:, 0]))
        posterior = AutoregressiveGp().fit(runs(z, value, level))
        held_out = rng.standard_normal((400, 5))
        mean, variance = posterior.latent(held_out, 1)
        off = np.abs(posterior.transform(rosenbrock(held_out)) - mean)
        hits.append(np.mean(off < QUANTILE * np.sqrt(variance)))
    assert 0.85 < np.mean(hits) < 0.95


def test_a_quadratic_function_is_learnt_from_just_enough_points() -> None:
    d, rng = 10, np.random.default_rng(15)
    root, held_out = rng.standard_normal((d, d)), rng.standard_normal((300, d))

    def quadratic(z: Array) -> Array:
        return np.sum((z @ root + 1.0) ** 2, axis=1)

    z = rng.standard_normal(((d + 1) * (d + 2) // 2 + 10, d))
    mean, _ = AutoregressiveGp().fit(runs(z, quadratic(z))).predict(held_out, 0)
    assert np.std(mean - quadratic(held_out)) < 1e-3 * quadratic(held_out).std()


@pytest.mark.parametrize(
    ("cheap", "low", "high"),
    [
        (waves, 0.8, 1.15),
        (lambda z: 0.8 * rosenbrock(z) + 5.0 * np.sin(z[:, 0]) + 2.0, 0.0, 0.4),
        (lambda z: 3.0 - rosenbrock(z) + 2.0 * z[:, 0], 0.0, 0.9),
    ],
    ids=["unrelated", "related", "reversed"],
)
def test_the_cheap_level_helps_where_it_is_related(
    cheap: Function, low: float, high: float
) -> None:
    ratios = []
    for seed in range(3):
        rng = np.random.default_rng(seed)
        z, level = rng.standard_normal((140, 4)), np.repeat([0, 1], [110, 30])
        held_out = rng.standard_normal((400, 4))
        value = np.where(level == 1, rosenbrock(z), cheap(z))
        both = AutoregressiveGp().fit(runs(z, value, level))
        alone = AutoregressiveGp().fit(runs(z[110:], value[110:]))
        truth = rosenbrock(held_out)
        ratios.append(error(both, held_out, truth, 1) / error(alone, held_out, truth, 0))
    assert low < np.exp(np.mean(np.log(ratios))) < high


def test_soft_constraints_are_kept_out_of_the_smooth_part() -> None:
    # Where the constraint is met, nothing but the bowl is left to learn.
    rng = np.random.default_rng(16)
    z, held_out = rng.standard_normal((120, 4)), rng.standard_normal((400, 4))

    def penalty(z: Array) -> Array:
        return 5.0 * np.maximum(0.0, np.round(10.0 * z[:, 0]))

    counts = penalty(z)[:, None]
    apart = AutoregressiveGp().fit(runs(z, sphere(z) + counts[:, 0], counts=counts))
    whole = AutoregressiveGp().fit(runs(z, sphere(z) + counts[:, 0]))
    free = held_out[:, 0] < -0.3
    truth = sphere(held_out[free])
    errors = [np.mean(np.abs(p.predict(held_out[free], 0)[0] - truth)) for p in (apart, whole)]
    assert errors[0] < 0.9 * errors[1]


def hard_case(name: str) -> Observations:
    rng = np.random.default_rng(17)
    z, level = rng.standard_normal((40, 3)), np.repeat([0, 1], 20)
    value = sphere(z)
    match name:
        case "duplicates":
            return runs(np.tile(z, (2, 1)), np.tile(value, 2), np.tile(level, 2))
        case "constant":
            return runs(z, np.full(40, 5.0), level)
        case "one point":
            return runs(z[:1], value[:1])
        case "two points":
            return runs(z[:2], value[:2])
        case "one place":
            return runs(np.zeros((9, 3)), value[:9])
        case "a fixed input":
            return runs(z * np.array([1.0, 0.0, 1.0]), value, level)
        case "missing level":
            return runs(z, value, 3 * level)
        case "huge values":
            return runs(z, 10.0 ** (3.0 * value), level)
        case "some failed":
            return runs(z, np.where(z[:, 0] > 1.0, np.inf, value), level)
        case "the finest level failed":
            return runs(z, np.where(level == 1, np.inf, value), level)
        case "all failed but two":
            return runs(z, np.where(np.arange(40) < 38, np.inf, value), level)
    z = rng.standard_normal((2000, 13))
    return runs(z, sphere(z) + rng.standard_normal(2000), rng.integers(0, 3, 2000))


@pytest.mark.parametrize(
    "name",
    [
        "duplicates",
        "constant",
        "one point",
        "two points",
        "one place",
        "a fixed input",
        "missing level",
        "huge values",
        "some failed",
        "the finest level failed",
        "all failed but two",
        "2000 points",
    ],
)
def test_no_data_breaks_it(name: str) -> None:
    observations = hard_case(name)
    posterior = AutoregressiveGp().fit(observations)
    z = np.random.default_rng(18).standard_normal((9, observations.z.shape[1]))
    left_out = posterior.left_out()
    for result in (
        *posterior.predict(z, 1),
        *posterior.latent(z, 1),
        *posterior.latent_gradient(z, 1),
        posterior.sample(z, 1, 20, np.random.default_rng(19)),
        left_out.mean,
        left_out.observed,
    ):
        assert np.isfinite(result).all()
    assert (left_out.variance > 0.0).all()


def test_failed_runs_repel() -> None:
    rng = np.random.default_rng(20)
    z = rng.uniform(-1.0, 1.0, (80, 2))
    value = np.where(z[:, 0] > 0.3, np.inf, z[:, 1])
    posterior = AutoregressiveGp().fit(runs(z, value))
    mean, _ = posterior.latent(np.array([[-0.5, 0.0], [0.8, 0.0]]), 0)
    assert mean[1] > mean[0] + 0.5
    # The smooth part is not disturbed where runs finish.
    z = rng.uniform(-0.9, -0.3, (50, 2))
    assert np.max(np.abs(posterior.latent(z, 0)[0] - posterior.transform(z[:, 1]))) < 1e-3


@pytest.mark.parametrize(
    ("z", "value", "message"),
    [
        (np.zeros((2, 1)), np.full(2, np.inf), "no run finished"),
        (np.zeros((2, 1)), np.array([np.nan, 1.0]), "nan"),
        (np.full((2, 1), np.nan), np.ones(2), "not finite"),
        (np.zeros((2, 1)), np.ones(3), "one row a run"),
    ],
)
def test_wrong_observations_are_refused(z: Array, value: Array, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        runs(z, value)
