"""The runs from which effects are told apart: made once for a rig, shared by all its cases.

For each experiment the base parameters are spread over their ranges (Sobol). A part of the points
runs without any effect, some of these twice on another packing; the others have one effect each,
at strengths that fill its range evenly.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import qmc

from calibration.diagnosis.suspects import RigEffect
from calibration.posterior import from_unit, prior_transform, to_unit
from calibration.recordings.case import Parameter
from mfopt.arrays import Array, frozen
from mfopt.records.evaluation import Candidate, Evaluation
from surrogates.effects import NONE, Runs

OF_NULLS = 0.25  # of the runs of an experiment have no effect
REPLICATED = 0.25  # of these run twice


@dataclass(frozen=True, slots=True)
class Library:
    """Base parameters, and the effects that runs have."""

    parameters: tuple[Parameter, ...]
    effects: tuple[RigEffect, ...]
    seed: int

    @property
    def names(self) -> tuple[str, ...]:
        """All parameters of a run, in the order of its design."""
        others = [name for effect in self.effects for name in effect.absent]
        return (*(p.name for p in self.parameters), *others)

    def design(self, z: Array, strengths: Mapping[int, float]) -> Array:
        """The design (p,) of a run at base parameters (d,) in the unit cube, with some effects."""
        values = {name: v for its in self.effects for name, v in its.absent.items()}
        for effect, strength in strengths.items():
            values |= self.effects[effect].at(strength)
        return np.concatenate([from_unit(self.parameters, z), list(values.values())])

    def planned(self, experiments: Sequence[str], each: int) -> list[Candidate]:
        """So many runs of each experiment, the experiments in turn.

        The seed of a run is its number among those of its experiment, so that further experiments
        change none.
        """
        rows = [self._points(name, each) for name in experiments]
        made: list[Candidate] = []
        for number, points in enumerate(zip(*rows, strict=True), start=1):
            for name, (z, strengths) in zip(experiments, points, strict=True):
                x = frozen(self.design(z, strengths))
                made.append(Candidate(len(made), x, name, number, 0, "design"))
        return made

    def _points(self, name: str, each: int) -> list[tuple[Array, dict[int, float]]]:
        """Base parameters and effect of the runs of one experiment, in mixed order.

        A library of fewer runs is the beginning of one of more.
        """
        rng = np.random.default_rng([self.seed, *name.encode()])
        transform = prior_transform(self.parameters)
        sobol = qmc.Sobol(len(self.parameters) + 1, rng=rng)
        spread = sobol.random(1 << max(each - 1, 1).bit_length())
        turn, nulls = 0, list[Array]()
        made: list[tuple[Array, dict[int, float]]] = []
        for u in spread[:each]:
            z = np.asarray(transform(u[:-1]))
            if rng.random() < OF_NULLS or not self.effects:
                again = nulls and rng.random() < REPLICATED
                z = nulls[rng.integers(len(nulls))] if again else z
                nulls.append(z)
                made.append((z, {}))
                continue
            effect = turn % len(self.effects)
            turn += 1
            signed = self.effects[effect].signed
            made.append((z, {effect: float(2.0 * u[-1] - 1.0 if signed else u[-1])}))
        return made

    def runs(self, made: Sequence[Evaluation]) -> Runs:
        """Where runs of this library were made."""
        x = np.array([e.candidate.x for e in made])
        d = len(self.parameters)
        effect, strength = np.full(len(x), NONE), np.zeros(len(x))
        for number, its in enumerate(self.effects):
            column = x[:, self.names.index(its.varies)]
            there = column != its.null
            effect[there] = number
            strength[there] = [its.strength(v) for v in column[there]]
        return Runs(frozen(to_unit(self.parameters, x[:, :d])), effect, frozen(strength))
