"""Which further recording would tell most: simulated before anyone makes it.

Draws of the posterior are run under the conditions of each possible experiment. How its series
follow the parameters (a linear regression), and how they scatter beside that (packing and
measurement), say by how much its recording would narrow the posterior:

    C' = (C^-1 + J^T S^-1 J)^-1,    S = (packing + measurement) / repeats + allowance

C is the covariance of the posterior, J and S are those of the scores of the principal components.

Source: Chaloner & Verdinelli 1995, doi:10.1214/ss/1177009939, for a linear model.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.stats import chi2

from calibration.parts import ALLOWANCE
from calibration.posterior import Posterior, to_unit
from calibration.recordings.case import Case
from calibration.recordings.records import Noise, Recording
from calibration.runs import Evaluate, candidates
from mfopt.arrays import AnyArray, Array
from mfopt.records.calibration import Advice
from mfopt.records.evaluation import Evaluation
from mfopt.records.rig import TIME

RUNS = 24  # of each possible experiment
REPEATS = 3  # that would be recorded
POINTS = 20  # in time of each series
COMPONENTS = 4  # at most, of the series of an experiment
FAINT = 1e-6  # of the variance: a component below says nothing


def advise(
    case: Case,
    possible: Sequence[str],
    posterior: Posterior,
    noises: Mapping[str, Noise],
    evaluate: Evaluate,
    first: int,
) -> tuple[tuple[Advice, ...], list[Evaluation]]:
    """Simulate possible experiments.

    Args:
        case: with the parameters and the recordings made so far.
        possible: names of the experiments, which are the levels of their runs.
        posterior: of the recordings made so far.
        noises: measurement noise by channel; a channel that no one recorded has none.
        evaluate: makes the runs.
        first: runs that were made before.
    """
    rng = np.random.default_rng([case.seed, 3000])
    draws = to_unit(case.parameters, posterior.draws)
    points = [
        (Recording(name, {}, ()), draws[rng.integers(0, len(draws), RUNS)]) for name in possible
    ]
    made = evaluate(candidates(case.parameters, points, first, "possible"))
    recorded = {c for r in case.recordings for c in (*r.channels, *r.scalars)}
    return tuple(_advice(name, made, case, posterior, recorded, noises) for name in possible), made


def _advice(
    name: str,
    made: Sequence[Evaluation],
    case: Case,
    posterior: Posterior,
    recorded: set[str],
    noises: Mapping[str, Noise],
) -> Advice:
    its = [e for e in made if e.candidate.level == name]
    fine = [e for e in its if e.outcome.finished]
    names = [p.name for p in case.parameters]
    draws = to_unit(case.parameters, posterior.draws)
    scale = draws.std(axis=0)
    if len(fine) < 2 * (len(names) + 1) or not scale.all():
        return Advice(name, dict.fromkeys(names, 1.0), len(its) - len(fine))
    rows, measured = _rows([e.outcome.raw for e in fine], recorded, noises)
    z = to_unit(case.parameters, np.array([e.candidate.x for e in fine]))
    # In the posterior's own directions, each with variance 1: a ridge is as wide as its width.
    root = np.linalg.cholesky(posterior.correlation + 1e-9 * np.eye(len(names)))
    own = np.linalg.solve(root, ((z - draws.mean(axis=0)) / scale).T).T
    after = np.linalg.inv(np.eye(len(names)) + _information(own, rows, measured))
    narrower = np.sqrt(np.diag(root @ after @ root.T))
    return Advice(name, dict(zip(names, map(float, narrower), strict=True)), len(its) - len(fine))


def _rows(
    runs: Sequence[Mapping[str, AnyArray]], recorded: set[str], noises: Mapping[str, Noise]
) -> tuple[Array, Array]:
    """What each run gives (n, p), and the variance (p,) of measuring it.

    Only channels that are recorded already, if the experiment has some of them.
    """
    there = sorted(set.intersection(*({*run} for run in runs)) - {TIME})
    chosen = [c for c in there if c in recorded] or there
    blocks, variances = [], []
    for channel in chosen:
        if np.ndim(runs[0][channel]) == 0:
            block = np.array([[float(run[channel])] for run in runs])
        else:
            end = min(float(run[TIME][-1]) for run in runs)
            times = np.linspace(0.0, end, POINTS)
            block = np.array([np.interp(times, run[TIME], run[channel]) for run in runs])
        noise = noises[channel].sigma if channel in noises else 0.0
        blocks.append(block)
        variances.append(np.full(block.shape[1], noise**2))
    return np.hstack(blocks), np.concatenate(variances)


def _information(z: Array, rows: Array, measured: Array) -> Array:
    """J^T S^-1 J (d, d), for parameters z (n, d) of variance 1.

    The regression's own doubt in J adds to it, k (Z^T Z)^-1 on average. What it adds in one case
    of twenty is taken off, so that no experiment is advised by chance.
    """
    from sklearn.decomposition import PCA  # a second, which only this needs

    moving = rows.std(axis=0) > 0.0
    if not moving.any():
        return np.zeros((z.shape[1], z.shape[1]))
    scale = rows[:, moving].std(axis=0)
    standard = (rows[:, moving] - rows[:, moving].mean(axis=0)) / scale
    pca = PCA(min(COMPONENTS, len(z) - 1, standard.shape[1]), svd_solver="full").fit(standard)
    components = pca.components_[pca.explained_variance_ratio_ > FAINT]
    scores = standard @ components.T
    design = np.column_stack([np.ones(len(z)), z])
    slopes = np.linalg.lstsq(design, scores, rcond=None)[0]
    beside = scores - design @ slopes
    packing = beside.T @ beside / (len(z) - design.shape[1])
    noise = components @ np.diag(measured[moving] / scale**2) @ components.T
    total = (packing + noise) / REPEATS + ALLOWANCE**2 * packing
    total += 1e-9 * np.trace(total) * np.eye(len(total))
    inverse, own = np.linalg.inv(total), np.linalg.inv(design.T @ design)[1:, 1:]
    chance = np.trace(inverse @ packing) * chi2.ppf(0.95, len(total)) / len(total)
    raw = slopes[1:] @ inverse @ slopes[1:].T - chance * own
    values, vectors = np.linalg.eigh(raw)
    return np.asarray(vectors @ np.diag(np.maximum(values, 0.0)) @ vectors.T)
