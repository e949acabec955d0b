"""Likelihood of standardised outputs with replicates, with its gradient in closed form."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from surrogates.training import Rows, Scaling
from surrogates.warp import Warp

JITTERS = (1e-10, 1e-8, 1e-6, 1e-4, 1e-2)  # of the level's variance, 1


@dataclass(frozen=True, slots=True, eq=False)
class Data:
    """Rows as tensors, sorted by level, with the map from runs to outputs."""

    x: torch.Tensor  # (n, d) standardised
    index: torch.Tensor  # (n,) level
    starts: tuple[int, ...]  # first row of each level
    replicates: torch.Tensor  # (n,)
    group: torch.Tensor  # (runs,) row of each
    value: torch.Tensor  # (runs,) objective
    warp: Warp
    centre: torch.Tensor  # (runs,)
    scale: float

    def outputs(self, compression: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Standardised outputs (runs,) and the log of the transform's slope, summed.

        Args:
            compression: logarithm of the transform's scale over that of `warp`.
        """
        knot, scale = self.warp.knot, self.warp.scale * torch.exp(compression)
        growth = torch.log1p(torch.clamp(self.value - knot, min=0.0) / scale)
        y = torch.clamp(self.value, max=knot) + scale * growth
        return (y - self.centre) / self.scale, -growth.sum()


def data_of(rows: Rows, scaling: Scaling, warp: Warp) -> Data:
    """Tensors of the rows."""
    level = rows.index[rows.group]
    return Data(
        x=torch.from_numpy(scaling.inputs(rows.z)),
        index=torch.from_numpy(rows.index),
        starts=tuple(int(start) for start in rows.starts),
        replicates=torch.from_numpy(rows.replicates),
        group=torch.from_numpy(rows.group),
        value=torch.from_numpy(np.array(rows.value)),
        warp=warp,
        centre=torch.from_numpy(scaling.centre[level]),
        scale=scaling.scale,
    )


class LogDensity(torch.autograd.Function):
    """log N(y; 0, K) up to a constant; twice as fast as the derivative of a Cholesky factor."""

    @staticmethod
    def forward(ctx: Any, covariance: torch.Tensor, y: torch.Tensor) -> torch.Tensor:
        """-(y' K^-1 y + log det K) / 2; the diagonal is raised until K has a Cholesky factor."""
        raised = covariance.clone()
        for jitter in JITTERS:
            raised.diagonal().add_(jitter)
            lower, info = torch.linalg.cholesky_ex(raised)
            if info == 0:
                break
        else:
            lower = torch.eye(len(y), dtype=y.dtype) * 1e150  # a value no search accepts
        inverse = torch.cholesky_inverse(lower)
        alpha = inverse @ y
        ctx.save_for_backward(inverse, alpha)
        density: torch.Tensor = -0.5 * (y @ alpha) - lower.diagonal().log().sum()
        return density

    @staticmethod
    def backward(ctx: Any, *grad_outputs: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """(alpha alpha' - K^-1) / 2 and -alpha: Rasmussen & Williams (2006), eq. 5.9."""
        inverse, alpha = ctx.saved_tensors
        (grad,) = grad_outputs
        return grad * 0.5 * (torch.outer(alpha, alpha) - inverse), -grad * alpha


def log_likelihood(
    data: Data, covariance: torch.Tensor, log_noise: torch.Tensor, compression: torch.Tensor
) -> torch.Tensor:
    """Log likelihood of all runs, up to a constant.

    The mean of k replicates has the noise variance divided by k. The scatter of the replicates
    around their mean depends on the noise alone, with k - 1 degrees of freedom.

    Args:
        data: the runs.
        covariance: (n, n) of the rows' noise-free values.
        log_noise: (levels,) logarithm of the noise variance of one run.
        compression: logarithm of the transform's scale over its default.
    """
    y, log_slopes = data.outputs(compression)
    total = torch.zeros(len(data.x), dtype=y.dtype).index_add(0, data.group, y)
    means = total / data.replicates
    noise = torch.exp(log_noise)
    covariance = covariance + torch.diag(noise[data.index] / data.replicates)
    density: torch.Tensor = LogDensity.apply(covariance, means)  # type: ignore[no-untyped-call]
    scatter = torch.zeros_like(means).index_add(0, data.group, (y - means[data.group]) ** 2)
    freedom = data.replicates - 1
    within = scatter / noise[data.index] + freedom * log_noise[data.index]
    return density - 0.5 * within.sum() + log_slopes
