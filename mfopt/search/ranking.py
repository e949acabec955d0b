"""What CMA-ES needs of a population is its ranking; here: how certain that ranking is.

Source: Hansen, arXiv:1604.00772, eqs. 49-53 (weights).
"""

import numpy as np

from mfopt.arrays import Array


def recombination_weights(population_size: int) -> Array:
    """Weight (population_size,) by rank, the best first: positive ones sum to 1, as negative."""
    parents = population_size // 2
    raw = np.log((population_size + 1) / 2.0) - np.log(np.arange(1, population_size + 1))
    positive, negative = np.clip(raw, 0.0, None), np.clip(-raw, 0.0, None)
    positive[parents:] = 0.0
    return np.asarray(positive / positive.sum() - negative / negative.sum())


def expected_weights(draws: Array) -> Array:
    """Weight (n,) that each candidate can expect, over joint draws (draws, n) of its values."""
    ranks = np.argsort(np.argsort(draws, axis=1), axis=1)
    return np.asarray(recombination_weights(draws.shape[1])[ranks].mean(axis=0))


def certainty(expected: Array) -> float:
    """How far the ranking is decided: 1 if every draw ranks alike, near 0 if by chance."""
    decided = recombination_weights(len(expected))
    return float(expected @ expected / (decided @ decided))
