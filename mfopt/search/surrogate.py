"""What the search tells a surrogate, and what it may ask of it."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from mfopt.arrays import Array, BoolArray, IntArray, capped, frozen
from mfopt.checks import shown
from mfopt.errors import ConfigError

LEVEL_ARRAYS = (  # the fields of Hyperparameters with a row for each level
    "lengthscales",
    "signal_variances",
    "trend_variances",
    "trend_offsets",
    "separable_variances",
    "noise_variances",
    "rho",
)


@dataclass(frozen=True, slots=True, eq=False)
class Observations:
    """Runs that a surrogate learns from; rows with equal `z` and `level` are replicates.

    Args:
        z: (n, d) where the runs were, in the coordinates of the search.
        level: (n,) level of each run, 0 the coarsest.
        value: (n,) objective; infinite for a failed run. Beyond +-1e50 it counts as that.
        counts: (n, c) soft-constraint terms contained in `value`, weighted, at least 0.
    """

    z: Array
    level: IntArray
    value: Array
    counts: Array

    def __post_init__(self) -> None:
        object.__setattr__(self, "z", frozen(self.z))
        object.__setattr__(self, "value", frozen(capped(self.value)))
        object.__setattr__(self, "counts", frozen(capped(self.counts)))
        level = np.array(self.level, dtype=np.int64)
        level.flags.writeable = False
        object.__setattr__(self, "level", level)
        self._check()

    def _check(self) -> None:
        if self.z.ndim != 2 or self.counts.ndim != 2:
            raise ConfigError(
                f"observations: z of shape {self.z.shape} must be (n, d) and counts of shape "
                f"{self.counts.shape} must be (n, c); without soft constraints pass (n, 0)"
            )
        n = len(self.z)
        if not (self.level.shape == self.value.shape == (n,) and len(self.counts) == n):
            raise ConfigError(
                f"observations: {n} rows of z, {self.level.shape} levels, {self.value.shape} "
                f"values, {len(self.counts)} rows of counts; all must have one row a run"
            )
        if not np.isfinite(self.z).all():
            raise ConfigError("observations: z holds a value that is not finite")
        if np.isnan(self.value).any() or np.isneginf(self.value).any():
            raise ConfigError("observations: a value is nan or -inf; a failed run is +inf")
        if not np.isfinite(self.value).any():
            raise ConfigError("observations: no run finished; a surrogate needs at least one")
        if (self.level < 0).any():
            raise ConfigError("observations: a level is negative; 0 is the coarsest")
        if not (self.counts[np.isfinite(self.value)] >= 0.0).all():
            raise ConfigError("observations: a count of a finished run is negative or nan")


@dataclass(frozen=True, slots=True, eq=False)
class Hyperparameters:
    """What a fit has learnt; independent of the units of `z` and of the objective.

    Lengthscales are in standard deviations of the training inputs, variances in variances of the
    transformed values around the mean of their level, so a set of one fit is a good start for the
    next.

    Args:
        levels: the levels that had data, ascending; row k of the arrays belongs to `levels[k]`.
        lengthscales: (levels, d); row 0 of the coarsest level, then of each difference.
        signal_variances: (levels,) of the Matern part.
        trend_variances: (levels,) of the quadratic trend.
        trend_offsets: (levels,) of the quadratic trend: large means more linear.
        separable_variances: (levels,) of the quadratic trend without products of inputs.
        noise_variances: (levels,) of one run.
        rho: (levels,) scale from the level below to this one; 1: alike but for a difference.
            `rho[0]` is 0.
        compression: logarithm of the transform's scale over its default.
        counts: the same for each soft-constraint term; None for one that was 0 everywhere.
        failure: the same for the share of failed runs; None where none failed.
    """

    levels: tuple[int, ...]
    lengthscales: Array
    signal_variances: Array
    trend_variances: Array
    trend_offsets: Array
    separable_variances: Array
    noise_variances: Array
    rho: Array
    compression: float
    counts: tuple["Hyperparameters | None", ...] = ()
    failure: "Hyperparameters | None" = None

    def __post_init__(self) -> None:
        for name in LEVEL_ARRAYS:
            object.__setattr__(self, name, frozen(getattr(self, name)))


@dataclass(frozen=True, slots=True, eq=False)
class LeftOut:
    """Leave-one-out predictions on the transformed scale, one row a point and level.

    Args:
        z: (n, d) the points, replicates once.
        level: (n,) their levels.
        failed: (n,) whether the row stands for failed runs, whose value is assumed to be somewhat
            worse than the worst finished one; these come last.
        replicates: (n,) runs behind the row.
        observed: (n,) mean of the transformed observations.
        mean: (n,) what the other rows predict for it.
        variance: (n,) of that prediction of `observed`, noise included.
    """

    z: Array
    level: IntArray
    failed: BoolArray
    replicates: IntArray
    observed: Array
    mean: Array
    variance: Array


class Posterior(Protocol):
    """What is believed of the objective, at every level, after the observations.

    A level without observations is answered by the nearest observed level below it, or by the
    coarsest observed one.
    """

    @property
    def hyperparameters(self) -> Hyperparameters:
        """What the fit learnt; the start of the next fit."""

    def predict(self, z: Array, level: int) -> tuple[Array, Array]:
        """Mean (m,) and variance (m,) of the noise-free objective at `z` (m, d)."""

    def latent(self, z: Array, level: int) -> tuple[Array, Array]:
        """Mean (m,) and variance (m,) on the transformed scale, monotone in the objective."""

    def latent_gradient(self, z: Array, level: int) -> tuple[Array, Array]:
        """Mean (m,) on the transformed scale and its gradient (m, d), for a minimiser."""

    def sample(self, z: Array, level: int, draws: int, rng: np.random.Generator) -> Array:
        """Joint draws (draws, m) of the noise-free objective at `z` (m, d)."""

    def left_out(self) -> LeftOut:
        """Predict each training row from all others, hyperparameters unchanged."""

    def noise_variance(self, level: int) -> float:
        """Variance of one run on the transformed scale, on average over the training rows."""

    def transform(self, value: Array) -> Array:
        """Objective to transformed scale; monotone, the same for all levels."""

    def inverse(self, transformed: Array) -> Array:
        """Transformed scale to objective."""


def left_after_run(posterior: Posterior, variance: Array, level: int) -> Array:
    """What one run at `level` would leave of variances (m,) on the transformed scale."""
    noise = max(posterior.noise_variance(level), np.finfo(float).tiny)
    return variance * (noise / (variance + noise))


class Surrogate(Protocol):
    """Learns the objective at all levels from runs at any of them."""

    def fit(
        self,
        observations: Observations,
        start: Hyperparameters | None = None,
        refit: bool = True,
    ) -> Posterior:
        """Learn from all runs.

        Args:
            observations: the runs.
            start: what an earlier fit learnt; the search for better values begins there.
            refit: learn new hyperparameters; otherwise keep `start`, which is much cheaper.

        Raises:
            ConfigError: if `refit` is off without `start`, or `start` has other dimensions.
        """


def check_surrogate(surrogate: Surrogate) -> None:
    """Make sure that this is a surrogate, and not its class.

    Raises:
        ConfigError: if it is none.
    """
    if isinstance(surrogate, type):
        name = surrogate.__name__
        raise ConfigError(f"surrogate = {name} is a class; make one: surrogate = {name}()")
    if not callable(getattr(surrogate, "fit", None)):
        raise ConfigError(
            f"surrogate = {shown(surrogate)} cannot learn: it has no fit(); give one such as "
            "surrogates.autoregressive.AutoregressiveGp()"
        )
