"""The functions that the cases are made of: bbob, its noise, smooth fields, the wing.

Sources: Hansen, Finck, Ros & Auger, Real-Parameter Black-Box Optimization Benchmarking 2009,
Inria RR-6829 (noise-free) and RR-6869 (noisy), as coded in `cma.bbobbenchmarks`.
"""

import math
from typing import Any

import numpy as np
from cma import bbobbenchmarks

from benchmarks.search.case import Array, Function, Noise

MEASURABLE = 1e-8  # below it the noisy bbob functions are exact (RR-6869, eq. 4)


def bbob(number: int, instance: int, dimension: int) -> tuple[Function, float]:
    """The noise-free value of a bbob function, of a noisy one too, and its optimum."""
    function: Any = bbobbenchmarks.dictbbob[number](iinstance=instance)

    def value(x: Array) -> Any:
        return function._evalfull(np.asarray(x, dtype=float))[1]

    value(np.zeros(dimension))  # draws the optimum and the rotations
    return value, float(function.fopt)


def bbob_noise(number: int, dimension: int) -> Noise:
    """The noise model of f101 to f130, drawn from the generator that it is given.

    Gaussian f exp(beta N), uniform U**beta f max(1, (1e9 / f)**(alpha U')), and seldom
    Cauchy f + alpha max(0, 1000 + [U < p] N / |N'|). RR-6869, eqs. 1-3.
    """
    model: Any = bbobbenchmarks.dictbbob[number]
    if hasattr(model, "gaussbeta"):
        return _above_measurable(lambda f, rng: f * math.exp(model.gaussbeta * rng.normal()))
    if hasattr(model, "unifbeta"):
        alpha = model.unifalphafac * (0.49 + 1.0 / dimension)
        return _above_measurable(
            lambda f, rng: (
                rng.random() ** model.unifbeta * f * max(1.0, (1e9 / f) ** (alpha * rng.random()))
            )
        )
    return _above_measurable(
        lambda f, rng: (
            f + model.cauchyalpha * max(0.0, 1e3 + (rng.random() < model.cauchyp) * _cauchy(rng))
        )
    )


def additive(deviation: float) -> Noise:
    """Normal noise of the same size everywhere."""
    return lambda gap, rng: gap + deviation * rng.normal()


def multiplicative(share: float) -> Noise:
    """Normal noise in proportion to the value above the optimum."""
    return lambda gap, rng: gap + share * abs(gap) * rng.normal()


def field(dimension: int, rng: np.random.Generator, lengthscale: float) -> Function:
    """A smooth random field of zero mean and unit variance, by 64 random Fourier features.

    Source: Rahimi & Recht, NIPS 2007.
    """
    features = 64
    frequencies = rng.normal(size=(dimension, features)) / lengthscale
    phases = rng.uniform(0.0, 2.0 * np.pi, features)

    def value(x: Array) -> Any:
        return math.sqrt(2.0 / features) * np.cos(x @ frequencies + phases).sum(axis=-1)

    return value


WING_LOWER = np.array([150.0, 220.0, 6.0, -10.0, 16.0, 0.5, 0.08, 2.5, 1700.0, 0.025])
WING_UPPER = np.array([200.0, 300.0, 10.0, 10.0, 45.0, 1.0, 0.18, 6.0, 2500.0, 0.08])
WING_BEST = np.array([150.0, 220.0, 6.0, 0.0, 16.0, 0.5, 0.18, 2.5, 1700.0, 0.025])
WING_LEVELS = ("no paint, area 0.9", "area 0.8", "paint of one square foot", "full")


def wing_weight(x: Array, level: int) -> Any:
    """Weight of a light aircraft's wing [lb] on four levels, the last exact.

    Variables: wing area, fuel weight, aspect ratio, sweep [deg], dynamic pressure, taper,
    thickness, load factor, gross weight, paint weight. The coarser levels raise the area to a
    wrong power and forget that paint covers the whole area.

    Sources: Forrester, Sobester & Keane, Engineering Design via Surrogate Modelling, 2008;
    levels and costs 1:10:100:1000 of Zanjani Foumani et al., arXiv:2211.02732.
    """
    area, fuel, aspect, sweep, pressure, taper, thickness, load, gross, paint = np.moveaxis(
        np.asarray(x, dtype=float), -1, 0
    )
    power = (0.9, 0.8, 0.758, 0.758)[level]
    painted = (0.0, 1.0, 1.0, area)[level]
    cos = np.cos(np.radians(sweep))
    bare = 0.036 * area**power * fuel**0.0035 * (aspect / cos**2) ** 0.6 * pressure**0.006
    shape = taper**0.04 * (100.0 * thickness / cos) ** -0.3 * (load * gross) ** 0.49
    return bare * shape + painted * paint


def _above_measurable(noise: Noise) -> Noise:
    def measured(gap: float, rng: np.random.Generator) -> float:
        return gap if gap < MEASURABLE else noise(gap, rng) + 1.01 * MEASURABLE

    return measured


def _cauchy(rng: np.random.Generator) -> float:
    return float(rng.normal() / (abs(rng.normal()) + 1e-199))
