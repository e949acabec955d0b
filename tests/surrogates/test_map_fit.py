from dataclasses import replace

import numpy as np
import torch
from scipy.stats import multivariate_normal
from surrogate_cases import rosenbrock, sphere

from mfopt.search.surrogate import Hyperparameters
from surrogates.gaussian_process import component, weights
from surrogates.likelihood import LogDensity, data_of
from surrogates.map_fit import default, from_model, maximise, one_thread, to_model
from surrogates.training import Rows, Scaling, rows_of, scaling_of
from surrogates.warp import Warp

WARP = Warp(5.0, 3.0)


def case() -> tuple[Rows, Scaling, Hyperparameters]:
    rng = np.random.default_rng(7)
    z = rng.standard_normal((30, 3))
    z[24:] = z[:6]
    level = np.repeat([0, 1, 2, 0], [12, 8, 4, 6])
    rows = rows_of(z, level, sphere(z) + rosenbrock(z) / 20.0 + 0.3 * rng.standard_normal(30))
    start = default((0, 1, 2), 3)
    lengthscales = rng.uniform(0.5, 2.0, (3, 3))
    changed = replace(start, lengthscales=lengthscales, rho=np.array([0.0, 0.8, -0.5]))
    return rows, scaling_of(rows, WARP), changed


def test_both_implementations_have_the_same_covariance() -> None:
    rows, scaling, h = case()
    x, table = scaling.inputs(rows.z), weights(h.rho)
    expected = np.zeros((len(x), len(x)))
    for k in range(3):
        g = table[k, rows.index]
        expected += g[:, None] * g * component(x, x, h, k)
    with torch.no_grad():
        found = to_model(h).covariance(data_of(rows, scaling, WARP)).numpy()
    np.testing.assert_allclose(found, expected, rtol=1e-6)


def test_replicates_have_the_likelihood_of_all_their_runs() -> None:
    # The density of all runs, one row each, moves with the hyperparameters as ours does.
    rows, scaling, h = case()

    def direct(h: Hyperparameters) -> float:
        x, table = scaling.inputs(rows.z)[rows.group], weights(h.rho)
        level = rows.index[rows.group]
        covariance = np.diag(h.noise_variances[level])
        for k in range(3):
            g = table[k, level]
            covariance += g[:, None] * g * component(x, x, h, k)
        warp = WARP.compressed(h.compression)
        y = (warp.forward(rows.value) - scaling.centre[level]) / scaling.scale
        slopes = np.log(warp.slope(rows.value)).sum()
        return float(multivariate_normal(np.zeros(len(y)), covariance).logpdf(y) + slopes)

    def ours(h: Hyperparameters) -> float:
        model, data = to_model(h), data_of(rows, scaling, WARP)
        prior = sum(p.log_prob(value(m)).sum().item() for _, m, p, value, _ in model.named_priors())
        return float(model.log_posterior(data).item() - prior)

    other = replace(h, noise_variances=np.array([0.3, 0.1, 0.02]), compression=0.7)
    assert abs((direct(other) - direct(h)) - (ours(other) - ours(h))) < 1e-5


def test_gradient_of_the_log_density() -> None:
    rng = np.random.default_rng(8)
    root = torch.from_numpy(rng.standard_normal((6, 9)))
    y = torch.from_numpy(rng.standard_normal(6)).requires_grad_()
    covariance = (root @ root.T + torch.eye(6)).requires_grad_()
    # Perturb symmetrically, as a covariance is.
    assert torch.autograd.gradcheck(
        lambda c, y: LogDensity.apply((c + c.T) / 2.0, y), (covariance, y), atol=1e-6
    )


def test_hyperparameters_survive_the_model() -> None:
    _, _, h = case()
    found = from_model(to_model(h), h.levels)
    np.testing.assert_allclose(found.lengthscales, h.lengthscales)
    np.testing.assert_allclose(found.rho, h.rho)
    np.testing.assert_allclose(found.noise_variances, h.noise_variances)


def test_climbing_raises_the_posterior_density() -> None:
    rows, scaling, h = case()
    data = data_of(rows, scaling, WARP)
    found = maximise(rows, scaling, WARP, [h], 10)
    assert to_model(found).log_posterior(data) > to_model(h).log_posterior(data) + 1.0


def test_the_callers_number_of_threads_is_left_alone() -> None:
    before = torch.get_num_threads()
    with one_thread():
        assert torch.get_num_threads() == 1
    assert torch.get_num_threads() == before
