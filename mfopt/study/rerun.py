"""What a corrected simulation changes for a machine: stored designs of a study, run with both.

The best designs and some worse ones run with the physics of the study and with that of the
material, each on the same seeds. Does their order change, and is another one the best?
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import kendalltau

from fidelity.level import SceneLevel
from mfopt.arrays import Array
from mfopt.errors import ConfigError
from mfopt.records.diagnosis import Consequence, Rerun
from mfopt.records.evaluation import Candidate, Evaluation
from mfopt.records.level import Ladder
from mfopt.records.objective import Objective, judged
from mfopt.records.outcome import Outcome
from mfopt.study.assemble import Assembled, assemble
from mfopt.study.material import with_material
from mfopt.study.material_file import MaterialSettings
from mfopt.study.stored import open_stored

DESIGNS = 10
BEST = 5  # of them are the best of the study, the others are spread over the rest
SEEDS = 3
NAMES = ("before", "after")

Made = Callable[[Ladder, Sequence[Candidate]], list[tuple[Candidate, Outcome]]]


@dataclass(frozen=True, slots=True, eq=False)
class Planned:
    """Designs of a study, and the level on which they run with the old and the new physics."""

    study: str
    objective: Objective
    unit: str
    designs: tuple[Evaluation, ...]
    ladder: Ladder  # two levels


def planned(directory: Path, material: MaterialSettings) -> Planned:
    """The designs of a stored run, and both physics.

    Raises:
        ConfigError: if the directory holds no study of a scene with grains, too few finished
            designs, or the material does not hold for the study.
    """
    run, study = open_stored(directory)
    if study is None:
        raise ConfigError(f"--study {directory}: a run of mfopt.minimize has no scene of grains")
    where = str(run.study_file)
    corrected = with_material(study, material, where=where)
    both = [assemble(its, where=where) for its in (study, corrected)]
    levels = [_cheapest(parts, where) for parts in both]
    ladder = Ladder(tuple(replace(its, name=n) for its, n in zip(levels, NAMES, strict=True)))
    designs = _chosen([e for e in run.evaluations() if e.candidate.level == levels[0].name])
    if len(designs) < 2:
        raise ConfigError(
            f"--study {directory}: {len(designs)} designs have finished on the level "
            f"{levels[0].name!r}; at least 2 are needed to compare"
        )
    parts = both[0]
    objective = parts.criteria.objective(study.problem.objective)
    return Planned(study.study.name, objective, parts.problem.objective_unit, designs, ladder)


def rerun(its: Planned, made: Made) -> Consequence:
    """Run the designs with both physics on the same seeds, and compare."""
    asked = [
        Candidate(0, design.candidate.x, level, 1 + seed, 0, "predict")
        for seed in range(SEEDS)
        for design in its.designs
        for level in NAMES
    ]
    values: dict[tuple[str, int], list[float]] = {}
    places = {design.candidate.x.tobytes(): i for i, design in enumerate(its.designs)}
    for candidate, outcome in made(its.ladder, [replace(c, index=i) for i, c in enumerate(asked)]):
        key = candidate.level, places[candidate.x.tobytes()]
        values.setdefault(key, []).append(judged(its.objective, outcome)[1])
    count = len(its.designs)
    before, after = (np.array([np.mean(values[level, i]) for i in range(count)]) for level in NAMES)
    return Consequence(
        its.study, its.unit,
        tuple(
            Rerun(design.candidate.index, _finite(b), _finite(a))
            for design, b, a in zip(its.designs, before, after, strict=True)
        ),
        _order(before, after),
        its.designs[int(np.argmin(before))].candidate.index,
        its.designs[int(np.argmin(after))].candidate.index,
        _finite(float(after[int(np.argmin(before))] - after.min())),
    )  # fmt: skip


def _cheapest(parts: Assembled, where: str) -> SceneLevel:
    """The first level with grains.

    Raises:
        ConfigError: if there is none.
    """
    found = next((level for level in parts.ladder if isinstance(level, SceneLevel)), None)
    if found is None:
        raise ConfigError(f"{where}: no level simulates grains, so a material changes nothing")
    return found


def _chosen(made: Sequence[Evaluation]) -> tuple[Evaluation, ...]:
    """The best designs of a level, and others spread over the rest; each design once."""
    finished = sorted((e for e in made if math.isfinite(e.objective)), key=lambda e: e.objective)
    once = list({e.candidate.x.tobytes(): e for e in reversed(finished)}.values())[::-1]
    rest = once[BEST:]
    step = max(1, len(rest) // (DESIGNS - BEST))
    return tuple([*once[:BEST], *rest[step - 1 :: step]][:DESIGNS])


def _order(before: Array, after: Array) -> float:
    """Kendall's rank correlation; 1 where the order stays as it is."""
    found = float(kendalltau(before, after).statistic)
    return found if math.isfinite(found) else 0.0


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
