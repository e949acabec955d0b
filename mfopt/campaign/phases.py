"""What a study runs before and after its search: which designs, where and on which seeds.

Before it, the starts that a study names are run at a cheap level, and the search begins at the
best. After it, designs that may be the best are told apart at the target level; then the best and
the baseline are confirmed on fresh seeds, and run once more on a reference engine.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mfopt.arrays import Array
from mfopt.records.evaluation import Candidate, Evaluation, Purpose
from mfopt.records.problem import Problem

# Seeds of the search count from 1; those of the phases after it are far from them and fresh.
FINALIST_SEED = 500_000
CONFIRM_SEED = 1_000_000


@dataclass(frozen=True, slots=True, eq=False)
class Starts:
    """Designs that a search may start from."""

    designs: Mapping[str, Array]  # (d,) each, physical units
    level: str  # where they are compared
    seeds: int = 1

    def candidates(self, first_index: int) -> list[Candidate]:
        """Each design on the first seeds, which the search uses too."""
        designs = list(self.designs.values())
        return _on_seeds(designs, self.level, 1, self.seeds, first_index, "start")


@dataclass(frozen=True, slots=True)
class Finals:
    """How the best design is told from its rivals at the target level, by sequential halving.

    All rivals are run on the first seeds, the better half of them on twice as many more, and so
    on until one is left.

    Source: Karnin, Koren & Somekh, Almost optimal exploration in multi-armed bandits, ICML 2013.
    """

    designs: int = 1  # of the search; with 1 and no start nothing is run
    seeds: int = 3  # of the first round

    def runs(self, rivals: int) -> int:
        """Runs that it takes to tell so many rivals apart."""
        made, seeds = 0, self.seeds
        while rivals > 1:
            made, rivals, seeds = made + rivals * seeds, rivals // 2, 2 * seeds
        return made


NO_FINALS = Finals()


def finalists(
    designs: Sequence[Array], level: str, first_seed: int, seeds: int, first_index: int
) -> list[Candidate]:
    """Each finalist on so many seeds, counted from `FINALIST_SEED` on."""
    return _on_seeds(designs, level, FINALIST_SEED + first_seed, seeds, first_index, "finalist")


def _on_seeds(
    designs: Sequence[Array],
    level: str,
    first_seed: int,
    seeds: int,
    first_index: int,
    purpose: Purpose,
) -> list[Candidate]:
    pairs = [(x, seed) for x in designs for seed in range(first_seed, first_seed + seeds)]
    return [
        Candidate(first_index + n, x, level, seed, 0, purpose) for n, (x, seed) in enumerate(pairs)
    ]


def by_mean(evaluations: Sequence[Evaluation]) -> list[Array]:
    """The designs (d,) by their mean objective, the lowest first; none that has a failed run."""
    values: dict[bytes, list[float]] = {}
    designs: dict[bytes, Array] = {}
    for evaluation in evaluations:
        key = evaluation.candidate.x.tobytes()
        values.setdefault(key, []).append(evaluation.objective)
        designs[key] = evaluation.candidate.x
    means = {key: sum(f / len(its) for f in its) for key, its in values.items()}
    ranked = sorted(means, key=lambda key: means[key])
    return [designs[key] for key in ranked if np.isfinite(means[key])]


def confirmation(
    problem: Problem, x: Array, level: str, seeds: int, first_index: int
) -> list[Candidate]:
    """Runs of the best and the baseline design on the same fresh seeds."""
    designs: list[tuple[Purpose, Array]] = [
        ("confirm best", x),
        ("confirm baseline", problem.baseline),
    ]
    plan = [(purpose, x, seed) for seed in range(seeds) for purpose, x in designs]
    return [
        Candidate(first_index + n, x, level, CONFIRM_SEED + seed, 0, purpose)
        for n, (purpose, x, seed) in enumerate(plan)
    ]


def on_reference(confirmation: Sequence[Candidate], level: str) -> list[Candidate]:
    """The confirmation of its first seed once more, on the reference level."""
    after: dict[Purpose, Purpose] = {
        "confirm best": "reference best",
        "confirm baseline": "reference baseline",
    }
    index = confirmation[-1].index + 1
    return [
        replace(c, index=index + n, level=level, purpose=after[c.purpose])
        for n, c in enumerate(c for c in confirmation if c.seed == CONFIRM_SEED)
    ]
