"""SMT's multi-fidelity kriging with expected improvement (MFEGO).

The next design has the greatest expected improvement on the target level; it is evaluated on
all levels up to the one that takes away most variance for the square of its cost.

Sources: Meliani et al., AIAA 2019-3236; Le Gratiet, arXiv:1309.3188; SMT: Saves et al.,
Adv. Eng. Softw. 188 (2024) 103571.
"""

from itertools import pairwise
from typing import Any

import numpy as np
from scipy.stats import norm
from smt.applications import MFK

from benchmarks.search.case import Array, Meter

FIRST = (4.0, 2.0, 1.0)  # designs per variable on the cheap levels; the target gets 5 in all
TARGET_FIRST = 5
POOL = 4000  # random designs, half of them near the best, among which EI is maximised


def method(meter: Meter, seed: int) -> None:
    """First designs, nested over the levels, then one design at a time."""
    case, rng = meter.case, np.random.default_rng(seed)
    x: list[list[Array]] = [[] for _ in case.levels]
    y: list[list[float]] = [[] for _ in case.levels]

    def run(z: Array, up_to: int) -> None:
        for level in range(up_to + 1):
            x[level].append(z)
            y[level].append(meter(z, level))

    sizes = [int(f * case.dimension) for f in FIRST[: case.target]] + [TARGET_FIRST]
    designs = [case.z0, *rng.random((sizes[0] - 1, case.dimension))]
    for number, z in enumerate(designs):
        run(z, max(level for level, size in enumerate(sizes) if number < size))
    while True:
        model = _fit(x, y, case.noisy, seed)
        best = x[-1][int(np.argmin(model.predict_values(np.array(x[-1]))))]
        if case.noisy:
            meter.recommend(best)
        z = _most_promising(model, best, rng)
        run(z, _level(model, z, np.array(case.costs)))


def _fit(x: list[list[Array]], y: list[list[float]], noisy: bool, seed: int) -> Any:
    model = MFK(
        theta0=[1.0], theta_bounds=[1e-4, 20.0], eval_noise=noisy, n_start=2, seed=seed,
        print_global=False, propagate_uncertainty=False,
    )  # fmt: skip
    for level, (a, b) in enumerate(zip(x[:-1], y[:-1], strict=True)):
        model.set_training_values(np.array(a), np.array(b)[:, None], name=level)
    model.set_training_values(np.array(x[-1]), np.array(y[-1])[:, None])
    model.train()
    return model


def _most_promising(model: Any, best: Array, rng: np.random.Generator) -> Array:
    near = best + 0.05 * rng.normal(size=(POOL // 2, best.size))
    pool = np.vstack([rng.random((POOL // 2, best.size)), np.clip(near, 0.0, 1.0)])
    mean = model.predict_values(pool).ravel()
    deviation = np.sqrt(np.maximum(model.predict_variances(pool).ravel(), 1e-16))
    gain = float(model.predict_values(best[None])[0, 0]) - mean
    ei = gain * norm.cdf(gain / deviation) + deviation * norm.pdf(gain / deviation)
    return np.asarray(pool[int(np.argmax(ei))])


def _level(model: Any, z: Array, costs: Array) -> int:
    """Argmax of the variance taken away by runs up to a level, over their cost squared."""
    variances, rho2 = model.predict_variances_all_levels(z[None])
    own = [max(float(b - r * a), 0.0) for (a, b), r in zip(
        pairwise([float(v) for v in variances[0]]), [float(np.ravel(r)[0]) for r in rho2],
        strict=False)]  # fmt: skip
    own.insert(0, float(variances[0, 0]))
    gains = []
    for level in range(costs.size):
        gain = 0.0
        for i in range(level + 1):
            gain += own[i] * float(np.prod([np.ravel(r)[0] for r in rho2[i:]]))
        gains.append(gain / float(costs[: level + 1].sum()) ** 2)
    return int(np.argmax(gains))
