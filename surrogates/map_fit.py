"""Hyperparameters of the autoregressive process: maximum a posteriori, on GPyTorch.

Positive hyperparameters are optimised as logarithms, which have normal priors.

Sources: Hvarfner, Hellsten & Nardi, arXiv:2402.02229 (lengthscales grow with sqrt(d)); Snelson,
Rasmussen & Ghahramani, NIPS 16 (2004) (a learnt output transform and its Jacobian).
"""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import gpytorch
import numpy as np
import torch
from gpytorch.constraints import Positive
from gpytorch.kernels import LinearKernel, MaternKernel, PolynomialKernel, ScaleKernel
from gpytorch.priors import NormalPrior
from scipy.optimize import minimize
from torch.nn.utils import parameters_to_vector, vector_to_parameters

from mfopt.arrays import Array
from mfopt.search.surrogate import Hyperparameters
from surrogates.gaussian_process import CONSTANT_VARIANCE
from surrogates.likelihood import Data, data_of, log_likelihood
from surrogates.training import Rows, Scaling
from surrogates.warp import Warp


@dataclass(frozen=True, slots=True)
class Prior:
    """Normal prior of a raw hyperparameter, with start and bounds of the optimisation."""

    mean: float
    deviation: float
    start: float
    lowest: float
    highest: float


def _log_prior(median: float, deviation: float, widest: float = 10.0) -> Prior:
    location = math.log(median)
    return Prior(location, deviation, location, location - widest, location + widest)


# Times sqrt(d). Hvarfner et al. use the deviation sqrt(3), with which the lengthscales fit noise:
# errors are 3 % larger on 6 functions in 5 to 13 variables.
LENGTHSCALE = _log_prior(math.exp(math.sqrt(2.0)), 1.2, 6.0)
VARIANCE = _log_prior(0.3, 2.0)
DIFFERENCE_VARIANCE = _log_prior(0.1, 2.0)  # a level differs from the one below by less
OFFSET = _log_prior(1.0, 1.0, 4.0)
NOISE = Prior(math.log(1e-2), 3.0, math.log(1e-2), math.log(1e-8), math.log(10.0))
RHO = Prior(1.0, 0.5, 1.0, -3.0, 3.0)  # 1: as the level below; 0 (unrelated): two deviations away
COMPRESSION = Prior(0.0, 3.0, 0.0, -2.0, 12.0)
ROUGHER_SIGNAL = 3.0  # more Matern variance at the rougher start


class Model(gpytorch.Module):  # type: ignore[misc]
    """The kernels of all levels with priors on their hyperparameters.

    Args:
        d: number of inputs.
        levels: number of levels.
    """

    def __init__(self, d: int, levels: int) -> None:
        super().__init__()
        self.matern = torch.nn.ModuleList(
            ScaleKernel(
                MaternKernel(2.5, ard_num_dims=d, lengthscale_constraint=_positive()),
                outputscale_constraint=_positive(),
            )
            for _ in range(levels)
        )
        self.trend = torch.nn.ModuleList(
            ScaleKernel(
                PolynomialKernel(2, offset_constraint=_positive()),
                outputscale_constraint=_positive(),
            )
            for _ in range(levels)
        )
        self.separable = torch.nn.ModuleList(
            LinearKernel(variance_constraint=_positive()) for _ in range(levels)
        )
        for name in ("rho", "log_noise"):
            self.register_parameter(name, torch.nn.Parameter(torch.zeros(levels)))
        self.register_parameter("compression", torch.nn.Parameter(torch.zeros(())))
        self.double()
        self._set_priors(d)

    def _set_priors(self, d: int) -> None:
        shift = 0.5 * math.log(d)
        scaled = Prior(
            LENGTHSCALE.mean + shift,
            LENGTHSCALE.deviation,
            LENGTHSCALE.start + shift,
            LENGTHSCALE.lowest + shift,
            LENGTHSCALE.highest + shift,
        )
        self.priors: dict[str, Prior] = {}
        for name, _ in list(self.named_parameters()):
            if name.endswith("raw_lengthscale"):
                prior = scaled
            elif name.endswith(("raw_outputscale", "raw_variance")):
                prior = VARIANCE if ".0." in name else DIFFERENCE_VARIANCE
            elif name.endswith("raw_offset"):
                prior = OFFSET
            else:
                prior = {"rho": RHO, "log_noise": NOISE, "compression": COMPRESSION}[name]
            self.priors[name] = prior
            owner, _, last = name.rpartition(".")
            density = NormalPrior(
                torch.tensor(prior.mean, dtype=torch.float64),
                torch.tensor(prior.deviation, dtype=torch.float64),
            )
            of: Any = Model.noise_beyond_expected if name == "log_noise" else last
            self.get_submodule(owner).register_prior(f"{last}_prior", density, of)

    def noise_beyond_expected(self) -> torch.Tensor:
        """Log noise (levels,) minus the value expected from the level below.

        The expected value is halfway between the noise of the level below and the prior mean. A
        level with few runs tells little about noise, so other levels help.
        """
        halfway = 0.5 * (self.log_noise[:-1] - NOISE.mean)
        beyond: torch.Tensor = self.log_noise - torch.nn.functional.pad(halfway, (1, 0))
        return beyond

    def covariance(self, data: Data) -> torch.Tensor:
        """Covariance (n, n) of the noise-free values of all rows."""
        n, d = data.x.shape
        total = torch.zeros((n, n), dtype=torch.float64)
        for k, start in enumerate(data.starts):
            x = data.x[start:]
            own = self.matern[k](x).to_dense() + self.trend[k](x / math.sqrt(d)).to_dense()
            terms = torch.cat([x, (x**2 - 1.0) / math.sqrt(2.0)], dim=1) / math.sqrt(d)
            own = own + self.separable[k](terms).to_dense()
            if k == 0:
                total = own + CONSTANT_VARIANCE
                continue
            inherited = torch.where(torch.arange(n) >= start, self.rho[k], 1.0)
            total = total * torch.outer(inherited, inherited)
            total = total + torch.nn.functional.pad(own + CONSTANT_VARIANCE, (start, 0, start, 0))
        return total

    def log_posterior(self, data: Data) -> torch.Tensor:
        """Log density of runs and hyperparameters, up to a constant."""
        total = log_likelihood(data, self.covariance(data), self.log_noise, self.compression)
        for _, module, prior, closure, _ in self.named_priors():
            total = total + prior.log_prob(closure(module)).sum()
        return total


def _positive() -> Positive:
    return Positive(transform=torch.exp, inv_transform=torch.log)


@contextmanager
def one_thread() -> Iterator[None]:
    """Use one thread of torch inside, which is fastest for small matrices."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def to_model(hyperparameters: Hyperparameters) -> Model:
    """A model with these hyperparameters."""
    h = hyperparameters
    model = Model(h.lengthscales.shape[1], len(h.levels))
    values: dict[str, Array] = {
        "rho": h.rho,
        "log_noise": np.log(h.noise_variances),
        "compression": np.asarray(h.compression),
    }
    for k in range(len(h.levels)):
        values[f"matern.{k}.base_kernel.raw_lengthscale"] = np.log(h.lengthscales[k])
        values[f"matern.{k}.raw_outputscale"] = np.log(h.signal_variances[k])
        values[f"trend.{k}.raw_outputscale"] = np.log(h.trend_variances[k])
        values[f"trend.{k}.base_kernel.raw_offset"] = np.log(h.trend_offsets[k])
        values[f"separable.{k}.raw_variance"] = np.log(h.separable_variances[k])
    with torch.no_grad():
        for name, parameter in model.named_parameters():
            prior = model.priors[name]
            value = np.clip(values[name], prior.lowest, prior.highest)
            parameter.copy_(torch.from_numpy(np.array(value)).reshape(parameter.shape))
    return model


def from_model(model: Model, levels: tuple[int, ...]) -> Hyperparameters:
    """The hyperparameters that the model holds."""
    materns: list[Any] = list(model.matern)
    trends: list[Any] = list(model.trend)
    separables: list[Any] = list(model.separable)

    def array(tensors: list[torch.Tensor]) -> Array:
        return np.array([tensor.detach().numpy().reshape(-1) for tensor in tensors])

    return Hyperparameters(
        levels=levels,
        lengthscales=array([k.base_kernel.lengthscale for k in materns]),
        signal_variances=array([k.outputscale for k in materns])[:, 0],
        trend_variances=array([k.outputscale for k in trends])[:, 0],
        trend_offsets=array([k.base_kernel.offset for k in trends])[:, 0],
        separable_variances=array([k.variance for k in separables])[:, 0],
        noise_variances=np.exp(model.log_noise.detach().numpy()),
        rho=np.concatenate([[0.0], model.rho.detach().numpy()[1:]]),
        compression=model.compression.item(),
    )


def default(levels: tuple[int, ...], d: int) -> Hyperparameters:
    """The prior medians: a function close to quadratic."""
    count = len(levels)
    variances = np.full(count, math.exp(DIFFERENCE_VARIANCE.start))
    variances[0] = math.exp(VARIANCE.start)
    rho = np.full(count, RHO.start)
    rho[0] = 0.0
    return Hyperparameters(
        levels=levels,
        lengthscales=np.full((count, d), math.exp(LENGTHSCALE.start) * math.sqrt(d)),
        signal_variances=variances,
        trend_variances=variances,
        trend_offsets=np.full(count, math.exp(OFFSET.start)),
        separable_variances=variances,
        noise_variances=np.full(count, math.exp(NOISE.start)),
        rho=rho,
        compression=COMPRESSION.start,
    )


def rougher(start: Hyperparameters) -> Hyperparameters:
    """A second start: a function that varies within few standard deviations of the inputs."""
    d = start.lengthscales.shape[1]
    return replace(
        start,
        lengthscales=np.full_like(start.lengthscales, math.sqrt(d)),
        signal_variances=ROUGHER_SIGNAL * start.signal_variances,
    )


def maximise(
    rows: Rows, scaling: Scaling, warp: Warp, starts: Sequence[Hyperparameters], iterations: int
) -> Hyperparameters:
    """Climb to a maximum of the posterior density of the hyperparameters.

    The density often has two maxima: a smooth function with much noise, and a rough function with
    little noise. So every start is tried for a few iterations, and the best one is continued.

    Args:
        rows: training rows.
        scaling: standardisation of inputs and outputs.
        warp: the transform at compression 0.
        starts: first points.
        iterations: of L-BFGS-B, at most, for each trial and for the last climb.
    """
    with one_thread():
        data = data_of(rows, scaling, warp)
        best, _ = min((_climb(data, s, iterations) for s in starts), key=lambda found: found[1])
        if len(starts) > 1:
            best, _ = _climb(data, best, iterations)
        return replace(best, levels=rows.levels)


def _climb(data: Data, start: Hyperparameters, iterations: int) -> tuple[Hyperparameters, float]:
    """L-BFGS-B from `start`; also the cost at its end."""
    model = to_model(start)
    parameters = list(model.parameters())

    def cost(raw: Array) -> tuple[float, Array]:
        vector_to_parameters(torch.from_numpy(np.array(raw)), parameters)
        model.zero_grad()
        value = -model.log_posterior(data) / len(data.value)
        value.backward()  # type: ignore[no-untyped-call]
        slopes = [p.grad if p.grad is not None else torch.zeros_like(p) for p in parameters]
        return value.item(), parameters_to_vector(slopes).numpy()

    bounds = [
        (model.priors[name].lowest, model.priors[name].highest)
        for name, parameter in model.named_parameters()
        for _ in range(parameter.numel())
    ]
    first = parameters_to_vector(parameters).detach().numpy()
    limits = {"maxiter": iterations, "maxfun": iterations + iterations // 3 + 2}
    found = minimize(cost, first, jac=True, method="L-BFGS-B", bounds=bounds, options=limits)
    vector_to_parameters(torch.from_numpy(np.array(found.x)), parameters)
    return from_model(model, start.levels), float(found.fun)
