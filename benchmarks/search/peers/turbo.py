"""TuRBO-1: a Gaussian process in one trust region, Thompson sampling.

The region is centred at the best value (noisy: at the lowest posterior mean), its sides follow
the lengthscales; it doubles after `SUCCESSES` batches with progress, halves after
ceil(max(4 / batch, d / batch)) without, and the search starts anew below `SHORTEST`.
One region, batch of `BATCH`; candidates perturb about 20 coordinates of the centre.

Source: Eriksson et al., NeurIPS 2019, arXiv:1910.01739, algorithm and settings of sections 2
and S.1 of its supplement.
"""

import math
import warnings
from typing import Any

import gpytorch
import numpy as np
import torch

from benchmarks.search.case import Array, Case, Meter, Trace, spend

BATCH = 10
SUCCESSES = 3
LONGEST, FIRST_LENGTH, SHORTEST = 1.6, 0.8, 0.5**7
TRAINING_STEPS = 50  # of Adam, rate 0.1
CANDIDATES = 100  # per variable, at most 5000
PROGRESS = 1e-3  # of the best value, for a batch to count as a success


def turbo(case: Case, budget: float, seed: int) -> Trace:
    """TuRBO-1 on the target level, restarted from a fresh design when its region collapses."""

    def run(meter: Meter) -> None:
        torch.manual_seed(seed)
        torch.set_num_threads(1)
        rng = np.random.default_rng(seed)
        first = [case.z0, *rng.random((2 * case.dimension - 1, case.dimension))]
        while True:
            _one_region(meter, rng, first)
            first = list(rng.random((2 * case.dimension, case.dimension)))

    return spend(case, budget, seed, run)


def _one_region(meter: Meter, rng: np.random.Generator, first: list[Array]) -> None:
    """One trust region until it collapses."""
    d, noisy = meter.case.dimension, meter.case.noisy
    z = np.array(first)
    f = np.array([meter(row) for row in z])
    length, successes, failures = FIRST_LENGTH, 0, 0
    while length >= SHORTEST:
        model = _fit(z, f)
        centre = z[int(np.argmin(_mean(model, z) if noisy else f))]
        if noisy:
            meter.recommend(centre)
        new = _thompson(model, centre, length, rng)
        values = np.array([meter(row) for row in new])
        improved = values.min() < f.min() - PROGRESS * abs(f.min())
        successes, failures = (successes + 1, 0) if improved else (0, failures + 1)
        z, f = np.vstack([z, new]), np.concatenate([f, values])
        if successes == SUCCESSES:
            length, successes = min(2.0 * length, LONGEST), 0
        elif failures == math.ceil(max(4.0 / BATCH, d / BATCH)):
            length, failures = length / 2.0, 0


class _Process(gpytorch.models.ExactGP):  # type: ignore[misc]
    """Constant mean, ARD Matern-5/2, with the bounds of the paper's supplement."""

    def __init__(self, z: torch.Tensor, f: torch.Tensor, likelihood: Any) -> None:
        super().__init__(z, f, likelihood)
        interval = gpytorch.constraints.Interval
        self.mean_module = gpytorch.means.ConstantMean()
        self.covar_module = gpytorch.kernels.ScaleKernel(
            gpytorch.kernels.MaternKernel(
                nu=2.5, ard_num_dims=z.shape[1], lengthscale_constraint=interval(0.005, 2.0)
            ),
            outputscale_constraint=interval(0.05, 20.0),
        )

    def forward(self, z: torch.Tensor) -> Any:
        return gpytorch.distributions.MultivariateNormal(self.mean_module(z), self.covar_module(z))


def _fit(z: Array, f: Array) -> _Process:
    """The process on standardised values, hyperparameters by Adam on the likelihood."""
    spread = f.std()
    scaled = (f - np.median(f)) / (spread if spread > 1e-12 else 1.0)
    x, y = torch.tensor(z), torch.tensor(scaled)
    likelihood = gpytorch.likelihoods.GaussianLikelihood(
        noise_constraint=gpytorch.constraints.Interval(5e-4, 0.2)
    )
    model: _Process = _Process(x, y, likelihood).double()
    model.covar_module.outputscale = 1.0
    model.covar_module.base_kernel.lengthscale = 0.5
    likelihood.noise = 0.005
    model.train()
    likelihood.train()
    objective = gpytorch.mlls.ExactMarginalLogLikelihood(likelihood, model)
    adam = torch.optim.Adam(model.parameters(), lr=0.1)
    for _ in range(TRAINING_STEPS):
        adam.zero_grad()
        loss = -objective(model(x), y)
        loss.backward()
        adam.step()
    model.eval()
    likelihood.eval()
    return model


def _mean(model: _Process, z: Array) -> Array:
    with torch.no_grad(), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of gpytorch: predicting where it was trained
        return np.asarray(model(torch.tensor(z)).mean)


def _thompson(model: _Process, centre: Array, length: float, rng: np.random.Generator) -> Array:
    """The minimisers of `BATCH` joint posterior draws over random points of the region."""
    d = centre.size
    scale = model.covar_module.base_kernel.lengthscale.detach().numpy().ravel()
    sides = scale / np.exp(np.mean(np.log(scale)))
    lower = np.clip(centre - sides * length / 2.0, 0.0, 1.0)
    upper = np.clip(centre + sides * length / 2.0, 0.0, 1.0)
    count = min(CANDIDATES * d, 5000)
    changed = rng.random((count, d)) < min(20.0 / d, 1.0)
    changed[np.flatnonzero(~changed.any(axis=1)), rng.integers(d)] = True
    pool = np.where(changed, lower + rng.random((count, d)) * (upper - lower), centre)
    with torch.no_grad(), gpytorch.settings.max_cholesky_size(10_000):
        draws = model(torch.tensor(pool)).sample(torch.Size([BATCH])).numpy()
    chosen: list[int] = []
    for draw in draws:
        order = (int(i) for i in np.argsort(draw))
        chosen.append(next(i for i in order if i not in chosen))
    return np.asarray(pool[chosen])
