"""Evidence of a hypothesis: the mean of its likelihood over its priors.

At a given strength the base parameters are integrated as if their peak were normal (Laplace). The
strength of one effect is integrated over nodes: some over its range, more around each peak. Pairs
of effects are integrated as if their highest peak were normal.

Source: MacKay 2003, Information Theory, Inference, and Learning Algorithms, ch. 27 and 28.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp
from scipy.stats import qmc

from calibration.diagnosis.climb import Climbed, climb
from calibration.diagnosis.joint import NOTHING, Hypothesis, Joint, Suspect
from mfopt.arrays import Array, frozen

STARTS = 8  # points from which the base parameters are fitted
NODES = 13  # strengths over a range; of a signed one on each side of zero half as many more
PEAKS = 2  # that are looked at closely
CLOSE = np.linspace(-3.0, 3.0, 9)  # [standard deviations] nodes around a peak
WEAK = 0.3  # strength from which the second of two effects climbs
DRAWS = 400


@dataclass(frozen=True, slots=True, eq=False)
class Weighed:
    """How likely a hypothesis makes the recordings, and what it leaves possible."""

    which: Hypothesis
    log_evidence: float
    best: Array  # (D,) the most likely point of the unit cube
    log_likelihood: float  # there
    misfit: float  # there, chi-squared
    draws: Array  # (m, D) equally likely points

    def strength(self, number: int, tail: float) -> float:
        """Strength of a suspect below which that share of the draws lies."""
        d = self.draws.shape[1] - self.which.added
        return float(np.quantile(self.which.strengths(self.draws[:, d:])[:, number], tail))


def weigh_nothing(joint: Joint, dimensions: int, seed: int) -> Weighed:
    """The hypothesis that nothing is missing, with so many base parameters."""
    rng = np.random.default_rng(seed)
    starts = np.vstack([np.full(dimensions, 0.5), qmc.Sobol(dimensions, rng=rng).random(STARTS)])
    return _peak(NOTHING, climb(joint, NOTHING, joint.scores, starts), rng)


def weigh_one(joint: Joint, which: Hypothesis, base: Array, seed: int) -> Weighed:
    """A hypothesis with one strength; `base` (d,) is where the fit of nothing is best."""
    d, rng = len(base), np.random.default_rng(seed)
    signed = not which.other and which.suspects[0].signed
    nodes = np.linspace(0.0, 1.0, NODES + NODES // 2 if signed else NODES)
    start = np.hstack([np.tile(base, (len(nodes), 1)), nodes[:, None]])
    wide = climb(joint, which, joint.scores, start, d)
    close = [
        climb(joint, which, joint.scores, points, d)
        for points in _around(joint, which, wide, nodes[1])
    ]
    return _along(which, [wide, *close], rng)


def weigh_pair(joint: Joint, first: Weighed, second: Suspect, seed: int) -> Weighed:
    """One effect more, beside that of a hypothesis with one."""
    which = Hypothesis((*first.which.suspects, second))
    strengths = (0.5 - WEAK / 2.0, 0.5 + WEAK / 2.0) if second.signed else (WEAK / 2.0, 2.0 * WEAK)
    start = np.array([[*first.best, s] for s in strengths])
    return _peak(which, climb(joint, which, joint.scores, start), np.random.default_rng(seed))


def _around(joint: Joint, which: Hypothesis, wide: Climbed, apart: float) -> list[Array]:
    """Points (9, D) around each of the highest peaks that are narrower than nodes are apart."""
    heights = np.concatenate([[-np.inf], wide.log_evidences, [-np.inf]])
    tops = np.flatnonzero((heights[1:-1] >= heights[:-2]) & (heights[1:-1] >= heights[2:]))
    tops = tops[np.argsort(-heights[1:-1][tops])][:PEAKS]
    if which.other:
        return []  # its size changes no mean, so there is nothing to climb by
    found = climb(joint, which, joint.scores, wide.points[tops])
    made = []
    for point, curvature in zip(found.points, found.curvature, strict=True):
        sd = math.sqrt(float(np.linalg.inv(curvature)[-1, -1]))
        if sd < apart:
            points = np.tile(point, (len(CLOSE), 1))
            points[:, -1] = np.clip(point[-1] + sd * CLOSE, 0.0, 1.0)
            made.append(points)
    return made


def _along(which: Hypothesis, parts: Sequence[Climbed], rng: np.random.Generator) -> Weighed:
    """Integrate over the strength, the last coordinate; between nodes the logarithm is linear."""
    points = np.concatenate([c.points for c in parts])
    order = np.argsort(points[:, -1], kind="stable")
    heights = np.concatenate([c.log_evidences for c in parts])[order]
    points, at = points[order], points[order, -1]
    width, rise = np.diff(at), np.diff(heights)
    steep = np.where(np.abs(rise) < 1e-6, 1.0, rise)  # else the mean of both ends is as good
    mean = np.where(np.abs(rise) < 1e-6, 1.0, -np.expm1(-np.abs(steep)) / np.abs(steep))
    with np.errstate(divide="ignore"):  # peaks may share a node
        areas = np.log(width) + np.maximum(heights[:-1], heights[1:]) + np.log(mean)
    total = float(logsumexp(areas))
    segments = rng.choice(len(areas), DRAWS, p=np.exp(areas - total))
    where = _within(rise[segments], rng.random(DRAWS))[:, None]
    middle = (1.0 - where) * points[segments] + where * points[segments + 1]
    curvature = np.concatenate([c.curvature for c in parts])[order][segments]
    middle[:, :-1] += _normal(curvature, rng)
    likely = np.concatenate([c.log_likelihoods for c in parts])[order]
    best = int(np.argmax(likely))
    misfit = float(np.concatenate([c.misfits for c in parts])[order][best])
    draws = np.clip(middle, 0.0, 1.0)
    return Weighed(
        which, total, frozen(points[best]), float(likely[best]), misfit, frozen(draws)
    )  # fmt: skip


def _within(rise: Array, u: Array) -> Array:
    """Places (m,) in segments of 0 to 1 over which the log density rises by so much (m,)."""
    flat = np.abs(rise) < 1e-6
    steep = np.clip(np.where(flat, 1.0, rise), -500.0, 500.0)
    return np.where(flat, u, np.log1p(u * np.expm1(steep)) / steep)


def _peak(which: Hypothesis, found: Climbed, rng: np.random.Generator) -> Weighed:
    """The highest of the peaks, taken as normal."""
    best = int(np.argmax(found.log_evidences))
    curvature = np.tile(found.curvature[best], (DRAWS, 1, 1))
    draws = np.clip(found.points[best] + _normal(curvature, rng), 0.0, 1.0)
    return Weighed(
        which, float(found.log_evidences[best]), frozen(found.points[best]),
        float(found.log_likelihoods[best]), float(found.misfits[best]), frozen(draws),
    )  # fmt: skip


def _normal(curvature: Array, rng: np.random.Generator) -> Array:
    """Draws (n, f) of normal distributions around 0 with these curvatures (n, f, f)."""
    factor = np.linalg.cholesky(curvature).transpose(0, 2, 1)
    noise = rng.standard_normal((*curvature.shape[:2], 1))
    return np.asarray(np.linalg.solve(factor, noise)[:, :, 0])
