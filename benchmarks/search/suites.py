"""The suites: which cases there are, and a case by its name.

| name | what |
|---|---|
| `bbob/f10/d13` | noise-free, one level |
| `noisy/f116/d13` | bbob-noisy f101-f130, one level |
| `noisy/f10-add5/d13`, `-mul30` | a bbob function under simple noise |
| `ladder/f10/b1/n30` | 3 levels, costs 1:8:64, 13 variables; bias 0.3 or 1; noise 0, 5, 30 |
| `bad/f10/useless`, `misleading`, `opposed` | the same with cheap levels that tell nothing or lie |
| `wing` | WingWeight, 10 variables, 4 levels, costs 1:10:100:1000 |

Noise 5 is normal with 5 % of the function's range, 30 with 30 % of the value above the optimum;
the range is the median value of random designs above the optimum.
"""

from collections.abc import Mapping
from functools import lru_cache, partial
from typing import Any

import numpy as np

from benchmarks.search.case import Array, Case, Function, Noise, exact
from benchmarks.search.functions import (
    WING_BEST,
    WING_LOWER,
    WING_UPPER,
    additive,
    bbob,
    bbob_noise,
    field,
    multiplicative,
    wing_weight,
)

LADDER_COSTS = (1.0, 8.0, 64.0)
LADDER_DIMENSION = 13
LEVEL_BIAS = (1.0, 0.4, 0.0)  # of the levels, in units of the ladder's bias
FIELD = 0.05  # deviation of the bias field at bias 1, in ranges: the coarsest level's optimum is
# then worth some 5-20 % of the first gap
SHIFT = 0.5  # shift of the coarse optimum at bias 1, in each variable [box width 10]
LENGTHSCALE = 5.0  # of the bias field; half the box width

UNIMODAL = (1, 6, 9, 10, 13)  # of the ladders' functions; f15 is Rastrigin
BAD_KINDS = ("useless", "misleading", "opposed")
_NOISE_FREE = (1, 2, 6, 8, 9, 10, 11, 12, 13, 14, 15, 21)
_BBOB_NOISY = (102, 105, 107, 110, 113, 116, 118, 119)
_SIMPLE_NOISY = (1, 9, 10)
_LADDER = (*UNIMODAL, 15)
_BAD = (1, 6, 9, 10)

SUITES: dict[str, tuple[str, ...]] = {
    "noise-free": tuple(f"bbob/f{n}/d{d}" for d in (10, 13, 20) for n in _NOISE_FREE),
    "noisy": (
        *(f"noisy/f{n}/d13" for n in _BBOB_NOISY),
        *(f"noisy/f{n}-{noise}/d13" for n in _SIMPLE_NOISY for noise in ("add5", "mul30")),
    ),
    "ladder": (
        *(f"ladder/f{n}/b{b}/n{s}" for n in _LADDER for b in ("0.3", "1") for s in (0, 5, 30)),
        "wing",
    ),
    "bad": tuple(f"bad/f{n}/{kind}" for n in _BAD for kind in BAD_KINDS),
}
UNDER_NOISE = (20, 30, 40)  # cells: 10 %, 3.2 %, 1 % of the first gap
TARGETS: Mapping[str, tuple[int, ...]] = {  # by suite
    "noise-free": (20, 40, 60, 80),  # 10 %, 1 %, 0.1 %, 1e-4
    "noisy": UNDER_NOISE,
    "ladder": UNDER_NOISE,
    "bad": UNDER_NOISE,
}


@lru_cache(maxsize=64)
def case_named(name: str, instance: int) -> Case:
    """The case of that name and instance.

    Raises:
        ValueError: if there is no such case.
    """
    try:
        kind, *rest = name.split("/")
        if kind == "bad" and rest[1] not in BAD_KINDS:
            raise KeyError(rest[1])
        if kind == "wing":
            return _wing(instance)
        if kind in ("bbob", "noisy"):
            function, _, noise = rest[0].removeprefix("f").partition("-")
            return _one_level(name, int(function), instance, int(rest[1][1:]), noise)
        number = int(rest[0].removeprefix("f"))
        if kind == "ladder":
            return _ladder(name, number, instance, float(rest[1][1:]), rest[2][1:])
        return _bad(name, number, instance, rest[1])
    except (ValueError, IndexError, KeyError) as error:
        raise ValueError(f"no case {name!r}; benchmarks/search/suites.py lists them") from error


def default_budget(case: Case) -> float:
    """Budget of a search in the case's own cost units."""
    if case.name.startswith("bad/"):
        return 200.0 * case.costs[-1]  # the cheap levels are no help
    if len(case.levels) > 1:
        return 40.0 * case.costs[-1]
    return 600.0 if case.noisy else 60.0 * case.dimension


def _rng(instance: int, number: int, dimension: int) -> np.random.Generator:
    return np.random.default_rng((20_240, instance, number, dimension))


def _box(dimension: int) -> tuple[Array, Array]:
    return np.full(dimension, -5.0), np.full(dimension, 5.0)


def _range(function: Function, optimum: float, dimension: int) -> float:
    points = np.random.default_rng(7).uniform(-5.0, 5.0, (1000, dimension))
    return float(np.median(function(points)) - optimum)


def _noise(kind: str, scale: float) -> Noise:
    return {
        "": exact, "0": exact,
        "add5": additive(0.05 * scale), "5": additive(0.05 * scale),
        "mul30": multiplicative(0.3), "30": multiplicative(0.3),
    }[kind]  # fmt: skip


def _one_level(name: str, number: int, instance: int, dimension: int, noise: str) -> Case:
    function, optimum = bbob(number, instance, dimension)
    chosen = (
        bbob_noise(number, dimension)
        if number > 100
        else _noise(noise, _range(function, optimum, dimension))
    )
    x0 = _rng(instance, number, dimension).uniform(-4.0, 4.0, dimension)
    return Case(name, instance, *_box(dimension), x0, (function,), (1.0,), optimum, chosen)


def _ladder(name: str, number: int, instance: int, bias: float, noise: str) -> Case:
    d = LADDER_DIMENSION
    function, optimum = bbob(number, instance, d)
    scale = _range(function, optimum, d)
    rng = _rng(instance, number, d)
    x0 = rng.uniform(-4.0, 4.0, d)
    shift = SHIFT * rng.normal(size=d)
    shared, *own = (field(d, rng, LENGTHSCALE) for _ in LADDER_COSTS)

    def biased(strength: float, alone: Function) -> Function:
        def value(x: Array) -> Any:
            error = (shared(x) + alone(x)) / np.sqrt(2.0)
            return function(x - strength * shift) + strength * FIELD * scale * error

        return value

    coarse = [biased(bias * b, o) for b, o in zip(LEVEL_BIAS, own, strict=False)]
    return Case(
        name, instance, *_box(d), x0, (*coarse, function), LADDER_COSTS, optimum,
        _noise(noise, scale),
    )  # fmt: skip


def _bad(name: str, number: int, instance: int, kind: str) -> Case:
    d = LADDER_DIMENSION
    function, optimum = bbob(number, instance, d)
    scale = _range(function, optimum, d)
    rng = _rng(instance, number, d)
    x0 = rng.uniform(-4.0, 4.0, d)
    levels = [
        _bad_level(function, optimum, scale, field(d, rng, LENGTHSCALE), kind)
        for _ in LADDER_COSTS[:-1]
    ]
    return Case(name, instance, *_box(d), x0, (*levels, function), LADDER_COSTS, optimum)


def _bad_level(
    function: Function, optimum: float, scale: float, noise: Function, kind: str
) -> Function:
    """A cheap level: unrelated to the target, with its optimum elsewhere, or upside down."""

    def value(x: Array) -> Any:
        if kind == "useless":
            return optimum + scale * (1.0 + noise(x))
        if kind == "misleading":
            return function(-x) + 0.02 * scale * noise(x)
        return 2.0 * optimum - function(x) + 0.02 * scale * noise(x)

    return value


def _wing(instance: int) -> Case:
    x0 = np.random.default_rng((20_241, instance)).uniform(WING_LOWER, WING_UPPER)
    levels = tuple(partial(wing_weight, level=level) for level in range(4))
    best = float(wing_weight(WING_BEST, 3))
    return Case(
        "wing", instance, WING_LOWER, WING_UPPER, x0, levels, (1.0, 10.0, 100.0, 1000.0), best
    )
