"""Which candidates of a generation are run: chosen on the surrogate, never by its mean alone."""

import numpy as np
from scipy.optimize import minimize

from mfopt.arrays import Array
from mfopt.search.surrogate import Posterior, left_after_run

STARTS = 3
ITERATIONS = 40
STEPS_BACK = 20  # between the minimiser and the origin
DECIDED = 0.5  # certainty of a generation's ranking at which no more of it is run
BLURRED = 0.5  # deviation of a run, in what candidates differ by, above which all are run
WALL = 10.0  # steepness of the trust region's wall, in deviations of the mean over the starts


def minimiser(posterior: Posterior, level: int, starts: Array, radius: float) -> Array:
    """Minimiser (d,) of the latent mean at `level` inside a ball, drawn back where noise misleads.

    Of the points between the origin and the minimiser it is that of lowest mean plus the deviation
    that a run there would leave: under noise the lowest mean is often far away, where nothing is
    known and one run settles little.

    Args:
        starts: (n, d) points; the search climbs down from the best few of them.
        radius: of the trust region, in the surrogate's coordinates.
    """
    inside = starts * np.minimum(1.0, radius / (np.linalg.norm(starts, axis=1) + 1e-12))[:, None]
    mean, _ = posterior.latent(inside, level)
    scale = float(np.std(mean)) or 1.0
    wall = WALL * scale

    def cost(u: Array) -> tuple[float, Array]:
        value, gradient = posterior.latent_gradient(u[None, :], level)
        length = float(np.linalg.norm(u))
        over = max(0.0, length - radius)
        slope = gradient[0] + 2.0 * wall * over * u / max(length, 1e-12)
        return float(value[0]) / scale + wall * over**2 / scale, slope / scale

    best, lowest = inside[int(np.argmin(mean))], np.inf
    for start in inside[np.argsort(mean, kind="stable")[:STARTS]]:
        found = minimize(
            cost, start, jac=True, method="L-BFGS-B", options={"maxiter": ITERATIONS},
            bounds=[(-radius, radius)] * len(start),  # or it runs off where the mean is flat
        )  # fmt: skip
        if found.fun < lowest:
            best, lowest = found.x, float(found.fun)
    length = float(np.linalg.norm(best))
    way = np.linspace(0.0, min(1.0, radius / max(length, 1e-12)), STEPS_BACK + 1)[:, None] * best
    mean, variance = posterior.latent(way, level)
    left = left_after_run(posterior, variance, level)
    return np.asarray(way[np.argmin(mean + np.sqrt(left))])


def thompson(draws: Array, taken: list[int], n: int) -> list[int]:
    """Choose `n` candidates, each the best of one joint draw among those not taken.

    Args:
        draws: (at least n, candidates) joint posterior draws.
        taken: candidates that are out.
    """
    chosen: list[int] = []
    for draw in draws[:n]:
        open_values = draw.copy()
        open_values[[*taken, *chosen]] = np.inf
        if not np.isfinite(open_values).any():
            break
        chosen.append(int(np.argmin(open_values)))
    return chosen


def blurred(posterior: Posterior, level: int, draws: Array) -> bool:
    """Whether runs scatter by so much of what the candidates differ by that all should be run.

    With fewer the distribution would shrink far below the noise, where nothing more is learnt.

    Args:
        draws: (draws, candidates) joint posterior draws.
    """
    spread = np.sqrt(posterior.transform(draws).var(axis=1).mean())
    return bool(np.sqrt(posterior.noise_variance(level)) > BLURRED * spread)
