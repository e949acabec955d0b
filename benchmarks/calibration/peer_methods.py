"""Ways to fit the parameters of a case, each of which spends the same number of runs.

mfopt's own fit; what an engineer does by hand; random search; L-BFGS-B; CMA-ES; surmise
(https://surmise.readthedocs.io): an emulator of principal components and Metropolis-Hastings.
`grainlearning_peer` is one more. What methods run beyond the fit does not count.
"""

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import cma
import numpy as np
from scipy.stats import qmc

from benchmarks.calibration.grainlearning_peer import grainlearning
from benchmarks.calibration.side_by_side import side_by_side
from calibration.campaign import calibrate
from calibration.least_squares import FAILED, Squares, fit_least_squares
from calibration.posterior import from_unit, prior_transform, to_unit
from calibration.recordings.case import Case
from calibration.recordings.records import Noise
from calibration.runs import Evaluate, candidates, predictions_of_each
from mfopt.arrays import Array
from mfopt.errors import SimulationError
from mfopt.records.evaluation import Candidate, Evaluation

Method = Callable[[Case, Mapping[str, Noise], Evaluate, int], Array]  # the parameters (d,) found

WIDTH = 0.3  # [of the ranges] of the first generation of CMA-ES
FLAT = 1e-3  # of the largest spread: points that vary less have no scale of their own
LEAST_VARIANCE = 1e-5
SAMPLES, BURNT = 6000, 2000  # of Metropolis-Hastings
STEP = 0.05  # [of the ranges] of its proposals
TRIED = 5  # values of one parameter by hand, before the next is tried
NARROWER = 0.4  # range of these values over that of the turn before


def mfopt(case: Case, noises: Mapping[str, Noise], evaluate: Evaluate, runs: int) -> Array:
    """The mean of the posterior."""
    campaign = calibrate(case, noises, evaluate, with_predictions(case, runs))
    z = to_unit(case.parameters, campaign.fitted.posterior.draws).mean(axis=0)
    return from_unit(case.parameters, z)


def by_hand(case: Case, noises: Mapping[str, Noise], evaluate: Evaluate, runs: int) -> Array:
    """The best of a few values of one parameter after the other, the range narrower each turn.

    The first turn is over the whole range, the other parameters in the middle of theirs.
    """
    squares = Squares(case, noises, evaluate, runs)
    best, half = np.full(len(case.parameters), 0.5), 0.5
    while squares.left >= TRIED:
        for place in range(len(best)):
            low, high = np.clip([best[place] - half, best[place] + half], 0.0, 1.0)
            z = np.tile(best, (min(TRIED, squares.left), 1))
            z[:, place] = np.linspace(low, high, TRIED)[: len(z)]
            if len(z) > 0:
                best[place] = z[np.argmin(squares(z)), place]
        half *= NARROWER
    return from_unit(case.parameters, best)


def random_search(case: Case, noises: Mapping[str, Noise], evaluate: Evaluate, runs: int) -> Array:
    """The smallest squares among draws of the prior."""
    squares, transform = Squares(case, noises, evaluate, runs), prior_transform(case.parameters)
    cube = np.random.default_rng([case.seed, 1]).random((squares.left, len(case.parameters)))
    z = np.array([transform(u) for u in cube])
    return from_unit(case.parameters, z[np.argmin(squares(z))])


def lbfgsb(case: Case, noises: Mapping[str, Noise], evaluate: Evaluate, runs: int) -> Array:
    """The smallest squares that L-BFGS-B found, with the same packings for all parameters."""
    return fit_least_squares(case, noises, evaluate, with_predictions(case, runs)).best


def cmaes(case: Case, noises: Mapping[str, Noise], evaluate: Evaluate, runs: int) -> Array:
    """The smallest squares that CMA-ES found, each run on a packing of its own.

    Raises:
        SimulationError: if every run failed.
    """

    def fresh(asked: Sequence[Candidate]) -> list[Evaluation]:
        return evaluate([replace(c, seed=c.index + 1) for c in asked])

    squares = Squares(case, noises, fresh, runs)
    dimension = len(case.parameters)
    options = {"bounds": [0.0, 1.0], "seed": case.seed, "verbose": -9}
    search = cma.CMAEvolutionStrategy(np.full(dimension, 0.5), WIDTH, options)
    while squares.left >= search.popsize:
        z = search.ask()
        values = squares(np.array(z))
        search.tell(z, np.where(np.isfinite(values), values, FAILED).tolist())
    if squares.best is None:
        raise SimulationError("every run of CMA-ES failed")
    return from_unit(case.parameters, squares.best)


def surmise(case: Case, noises: Mapping[str, Noise], evaluate: Evaluate, runs: int) -> Array:
    """The mean of the posterior that surmise samples, with one emulator for all recordings."""
    each, dimension = runs // len(case.fitted), len(case.parameters)
    sobol = qmc.Sobol(dimension, rng=np.random.default_rng(case.seed))
    transform = prior_transform(case.parameters)
    z = np.array([transform(u) for u in sobol.random(1 << (each - 1).bit_length())[:each]])
    made = evaluate(candidates(case.parameters, [(r, z) for r in case.fitted], 0, "design"))
    seen, kept, rows = side_by_side(case, noises, made)
    values = np.concatenate([o.values for o in seen])
    known = np.concatenate([np.diag(o.measured) + np.sum(o.constant**2, axis=1) for o in seen])
    return from_unit(case.parameters, _surmised(case, kept, rows, values, known))


def _surmised(case: Case, z: Array, rows: Array, recorded: Array, known: Array) -> Array:
    """Mean (d,) of the posterior in the unit cube.

    Args:
        case: with the priors.
        z: parameters (n, d) in the unit cube.
        rows: simulated values (n, p).
        recorded: values (p,).
        known: variance (p,) of their measurement.
    """
    with warnings.catch_warnings():  # it resets the filters of its caller
        from surmise import set_RNG
        from surmise.calibration import calibrator
        from surmise.emulation import emulator

        set_RNG(np.random.default_rng(case.seed))
        # It wants variances near 1.
        spread = rows.std(axis=0)
        scale = np.maximum(spread, FLAT * spread.max())
        rows, recorded, known = rows / scale, recorded / scale, known / scale**2
        points = np.arange(len(recorded), dtype=np.float64)[:, None]
        quiet = {"warnings": False}
        emulated = emulator(x=points, theta=z, f=rows.T, method="PCGP", args=quiet)
        packing = np.mean((emulated.predict(points, z).mean() - rows.T) ** 2, axis=1)
        fit = calibrator(
            emu=emulated, y=recorded, x=points, thetaprior=_Prior(case),
            method="directbayeswoodbury", yvar=np.maximum(known + packing, LEAST_VARIANCE),
            args={
                "sampler": "metropolis_hastings", "theta0": z.mean(axis=0)[None],
                "nSamples": SAMPLES, "nBurnSamples": BURNT,
                "stepType": "normal", "stepParam": np.full(z.shape[1], STEP), "verbose": False,
            },
        )  # fmt: skip
        return np.asarray(fit.theta.rnd(SAMPLES).mean(axis=0))


class _Prior:
    """What surmise asks of a prior: here even over the ranges."""

    def __init__(self, case: Case) -> None:
        self.dimension = len(case.parameters)
        self.rng = np.random.default_rng(case.seed)

    def lpdf(self, z: Array) -> Array:
        """Logarithm (n, 1) of the density at z (n, d)."""
        inside = np.all((z >= 0.0) & (z <= 1.0), axis=1)
        return np.where(inside, 0.0, -math.inf)[:, None]

    def rnd(self, count: int) -> Array:
        """Draws (count, d)."""
        return self.rng.random((count, self.dimension))


def with_predictions(case: Case, runs: int) -> int:
    """Runs in all, of which `runs` remain for the fit beside those that predict recordings."""
    each = len(case.recordings)
    totals = {count: runs + count * each for count in range(runs)}
    return next(all_ for count, all_ in totals.items() if predictions_of_each(case, all_) == count)


METHODS: Mapping[str, Method] = {
    "mfopt": mfopt, "by hand": by_hand, "random": random_search, "L-BFGS-B": lbfgsb,
    "CMA-ES": cmaes, "surmise": surmise, "GrainLearning": grainlearning,
}  # fmt: skip
