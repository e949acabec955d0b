"""The posterior of the parameters, by nested sampling.

Nested sampling (dynesty) needs no starting point, finds separate modes, and gives the evidence by
which models are compared. A run of some ten thousand likelihoods takes seconds.

Source: Skilling 2006, doi:10.1214/06-BA127; Speagle 2020, doi:10.1093/mnras/staa278.
"""

import io
import math
import warnings
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass

import numpy as np
from scipy.stats import truncnorm

from calibration.recordings.case import Parameter
from mfopt.arrays import Array, frozen

LIVE = 100  # points; the log evidence is known to about 0.2
STOP = 0.05  # of the log evidence that may be missing
DRAWS = 2000
LEVEL = 0.9  # of the intervals
NARROWEST = 1e-4  # [of the cube] half a width of a box


@dataclass(frozen=True, slots=True, eq=False)
class Posterior:
    """What the recordings leave possible."""

    parameters: tuple[Parameter, ...]
    draws: Array  # (n, d) in the parameters' units, equally likely
    best: Array  # (d,) the most likely draw
    log_evidence: float
    log_evidence_sd: float
    calls: int  # of the likelihood
    box: Array  # (2, d) in the cube of the prior: holds all draws, with half a width on each side

    def interval(self, level: float = LEVEL) -> Array:
        """Bounds (d, 2) that hold each parameter with that probability, in its unit."""
        tail = (1.0 - level) / 2.0
        return np.quantile(self.draws, [tail, 1.0 - tail], axis=0).T

    @property
    def correlation(self) -> Array:
        """Correlations (d, d) in the unit cube; 0 with a parameter that has one value only."""
        z = to_unit(self.parameters, self.draws)
        scale = z.std(axis=0)
        standard = (z - z.mean(axis=0)) / np.where(scale > 0.0, scale, 1.0)
        found = standard.T @ standard / len(z)
        np.fill_diagonal(found, 1.0)
        return np.asarray(found)

    @property
    def mean(self) -> Array:
        """Mean (d,)."""
        return np.asarray(self.draws.mean(axis=0))


def to_unit(parameters: Sequence[Parameter], x: Array) -> Array:
    """Parameters (..., d) in the unit cube of their ranges, or of the logarithms of these."""
    low, width = _ranges(parameters)
    return np.asarray((_even(parameters, x) - low) / width)


def from_unit(parameters: Sequence[Parameter], z: Array) -> Array:
    """Parameters (..., d) in their units."""
    low, width = _ranges(parameters)
    even = low + z * width
    columns = [np.exp(e) if p.log else e for p, e in zip(parameters, even.T, strict=True)]
    return np.asarray(np.array(columns).T)


def _even(parameters: Sequence[Parameter], x: Array) -> Array:
    """The parameters (..., d), or their logarithms."""
    columns = [np.log(v) if p.log else v for p, v in zip(parameters, np.asarray(x).T, strict=True)]
    return np.asarray(np.array(columns).T)


def prior_transform(parameters: Sequence[Parameter]) -> Callable[[Array], Array]:
    """From equally likely points of the cube (d,) to draws of the prior in the unit cube (d,)."""
    normal = {}
    for i, p in enumerate(parameters):
        if p.mean is not None and p.sd is not None:
            mean = float(to_unit([p], np.array([p.mean]))[0])
            sd = p.sd / (p.high - p.low)
            if p.log:
                sd = p.sd / p.mean / math.log(p.high / p.low)
            normal[i] = truncnorm(-mean / sd, (1.0 - mean) / sd, loc=mean, scale=sd)

    def transform(u: Array) -> Array:
        z = np.array(u)  # uniform priors change nothing
        for i, prior in normal.items():
            z[i] = prior.ppf(u[i])
        return z

    return transform


def _ranges(parameters: Sequence[Parameter]) -> tuple[Array, Array]:
    """Lower end and width (d,) of the ranges, or of their logarithms."""
    low = _even(parameters, np.array([p.low for p in parameters]))
    return low, _even(parameters, np.array([p.high for p in parameters])) - low


def sample(
    log_likelihood: Callable[[Array], float],
    parameters: Sequence[Parameter],
    *,
    seed: int,
    live: int = LIVE,
    around: Array | None = None,
) -> Posterior:
    """Sample the posterior.

    An emulator is sure of itself only where many runs are. A narrow peak there is surrounded by
    places that are less likely than all that is far from the runs, and random points miss it. With
    `around`, half of the points come from that box B of volume |B|. The likelihood is divided by
    the density 1/2 + 1/2 [u in B] / |B|, so posterior and evidence stay the same.

    Args:
        log_likelihood: at parameters (d,) in the unit cube.
        parameters: with their priors.
        seed: of the sampler.
        live: points; the error of the log evidence falls with the root of their number. There are
            more than two for each dimension.
        around: box (2, d) of a posterior of fewer runs; None: all of the prior.

    Source: Chen, Hobson, Das & Gelderblom 2019, doi:10.1007/s11222-018-9841-3.
    """
    from dynesty import NestedSampler  # a second, which only this needs

    rng = np.random.default_rng(seed)
    transform, d = prior_transform(parameters), len(parameters)
    box = np.array([np.zeros(d), np.ones(d)]) if around is None else around

    def likely(v: Array) -> float:
        u, log_density = _placed(v, box)
        return log_likelihood(transform(u)) - log_density

    with warnings.catch_warnings():
        # A wrong model ends in a corner, where all points are as likely as numbers can tell.
        warnings.filterwarnings("ignore", message="We have reached the plateau")
        # On an interruption dynesty prints where it was before it lets it pass.
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            # Random walks from live points: ridges are thin, and draws from ellipsoids miss them.
            sampler = NestedSampler(
                likely, lambda v: v, d + (around is not None),
                nlive=max(live, 2 * (d + 1) + 1), sample="rwalk", bootstrap=0, rstate=rng,
            )  # fmt: skip
            sampler.run_nested(dlogz=STOP, print_progress=False)
    results = sampler.results
    equal = results.samples_equal(rstate=rng)
    chosen = np.array([_placed(v, box)[0] for v in equal[rng.integers(0, len(equal), DRAWS)]])
    best = _placed(results.samples[-1], box)[0]
    half = np.maximum(np.ptp(chosen, axis=0) / 2.0, NARROWEST)
    return Posterior(
        parameters=tuple(parameters),
        draws=frozen(from_unit(parameters, np.array([transform(u) for u in chosen]))),
        best=frozen(from_unit(parameters, transform(best))),
        log_evidence=float(results.logz[-1]),
        log_evidence_sd=float(results.logzerr[-1]),
        calls=int(np.sum(results.ncall)),
        box=frozen(np.clip([chosen.min(axis=0) - half, chosen.max(axis=0) + half], 0.0, 1.0)),
    )


def _placed(v: Array, box: Array) -> tuple[Array, float]:
    """The point (d,) of the cube that v (d or d + 1,) stands for, and the log density there.

    The last of d + 1 coordinates decides between all of the cube and the box.
    """
    low, high = box
    if len(v) == len(low):
        return v, 0.0
    u = v[:-1] if v[-1] < 0.5 else low + v[:-1] * (high - low)
    inside = np.all((low <= u) & (u <= high))
    return u, math.log(0.5 + (0.5 / float(np.prod(high - low)) if inside else 0.0))
