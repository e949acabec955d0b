"""CMA-ES over a planned list of levels, as the paper ran it.

The search works in the unit cube. It starts anew from the best design so far where the level
changes and where CMA-ES has converged, and once a stage with two variables exchanged where it
sits in a minimum that the exchange leads out of (the cup that moves back: y1 > y2).
Impossible designs are drawn again and never simulated; requirements on the result are terms
of the objective. A stage may run candidates again whose ranking is in doubt.

Source: Hansen, arXiv:1604.00772; the paper's section 3.5 for the procedure.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain, count
from typing import Any

import numpy as np

from mfopt.arrays import Array, capped, distinct, frozen
from mfopt.checks import whole
from mfopt.errors import ConfigError
from mfopt.records.evaluation import Candidate, Generation, Insight
from mfopt.records.problem import Problem
from mfopt.search.noise_share import NoiseShare, belief, believed_values
from mfopt.search.pycma import mean_of, strategy, tell
from mfopt.search.reevaluation import EliteDoubt, NoReplicates, Reevaluation, UncertaintyHandling
from mfopt.search.search import MOST_SEED, Stage, usable
from mfopt.search.swap import Pair, Watch

TOLERANCE_X = 1e-3  # unit cube: finer than a workshop can make
TOLERANCE_F = 1e-5  # objective; 0.01 ms of dispersion


class CmaEs:
    """CMA-ES on the stages of a plan, one after the other.

    Args:
        problem: what to minimise over.
        stages: the planned levels, coarse to fine.
        seed: seed of all random draws.
        exchange: two variables to exchange where the first stays above the second.
        start: first design (d,), physical units; the baseline if left out.
        first_seed: seed of the first simulation; a stage uses `first_seed + 0 .. seeds - 1`, and
            for the k-th replicates of a generation as many, k x `seeds` further on.

    Raises:
        ConfigError: if an argument is wrong.
    """

    _es: Any  # cma.CMAEvolutionStrategy, which carries no types
    _best_f: float  # as believed
    _best_deviation: float
    _generations_in_stage: int
    _runs_in_stage: int  # of finished generations
    _in_stage: list[tuple[float, Array]]  # believed values and designs of the stage
    _rule: Reevaluation
    _noise: NoiseShare

    def __init__(
        self,
        problem: Problem,
        stages: Sequence[Stage],
        *,
        seed: int,
        exchange: Pair | None = None,
        start: Array | None = None,
        first_seed: int = 1,
    ) -> None:
        if not stages:
            raise ConfigError("the search has no stage: plan at least one level")
        self._problem = problem
        self._stages = tuple(stages)
        self._rng = np.random.default_rng(whole("seed", seed, 0, MOST_SEED))
        self._watch = Watch(problem, exchange)
        self._first_seed = first_seed
        self._asked = 0
        self._asked_z: dict[int, Array] = {}  # cma must be told the very arrays it drew
        self._drawn: list[Candidate] = []  # of the open generation
        self._again: list[tuple[int, Candidate]] = []  # replicates, and whose by position
        self._to_ask: list[Candidate] = []  # of both, those not asked yet
        self._told: dict[int, float] = {}  # and those that have a value
        self._best_x: Array | None = None
        self._insight: Insight | None = None
        self._positive = True  # every value told so far was above 0
        self._restarts = 0
        self._number = 1
        self._stage_number = 0
        first = problem.baseline if start is None else start
        z = problem.start(first)
        self._given = {z.tobytes(): frozen(first)}  # the start, by z, in physical units
        self._begin_stage(z, why="start")

    @property
    def generation(self) -> Generation:
        """The generation that the next `ask` belongs to."""
        stage = self._stage
        return Generation(
            self._number, stage.level, self._restarts, float(self._es.sigma),
            stage.population_size, stage.objective, self._why,
        )  # fmt: skip

    @property
    def work_left(self) -> list[tuple[str, int]]:
        """Runs that the plan still holds, by level."""
        left = [(s.level, s.runs) for s in self._later_stages]
        if self.should_stop() is None:
            left.insert(0, (self._stage.level, self._runs_left - len(self._told)))
        return left

    def ask(self, n: int | None = None) -> list[Candidate]:
        """Propose up to `n` of the generation, all that are left without `n`.

        None are left while a generation waits for its last values. Once it has them, those
        candidates follow that are to be run again. A generation shares one simulation seed, and
        so do the k-th replicates in it.
        """
        if not self._drawn and self.should_stop() is None:
            self._draw()
        count = len(self._to_ask) if n is None else n
        asked, self._to_ask = self._to_ask[:count], self._to_ask[count:]
        return asked

    def tell(
        self,
        candidates: Sequence[Candidate],
        values: Sequence[float],
        counts: Array | None = None,
    ) -> None:
        """Note the values; after the last of a generation update CMA-ES and move on.

        Runs of another purpose than "search", made before it, teach nothing here.
        """
        if all(candidate.purpose != "search" for candidate in candidates):
            return
        for candidate, value in zip(candidates, values, strict=True):
            self._told[candidate.index] = float(capped(usable(value)))
        if len(self._told) == len(self._drawn) + len(self._again):
            runs = self._runs
            left = self._runs_left - len(self._told)
            if again := self._rule.wanted(runs, self._noise, left):
                self._repeat(again)
            else:
                self._update(runs)

    def recommended(self) -> Array | None:
        """The best design told at the present stage, or at the one before if none is yet.

        With replicates, the one of the lowest believed value.
        """
        return self._best_x

    def finalists(self, n: int) -> list[Array]:
        """Up to `n` different designs (d,) that may be the best, the recommended one first.

        The second is the mean of the distribution, which averages noise away; the others are those
        of the lowest values at the present stage.
        """
        if self._best_x is None:
            return []
        centre = frozen(self._problem.to_x(mean_of(self._es)))
        means = [centre] if self._problem.impossible(centre) is None else []
        ranked = sorted(self._in_stage, key=lambda its: its[0])
        return distinct([self._best_x, *means, *(x for _, x in ranked)])[:n]

    @property
    def insight(self) -> Insight | None:
        """What replicates said of the last generation's ranking; without them nothing."""
        return self._insight

    def _draw(self) -> None:
        stage = self._stage
        seed = self._first_seed + self._generations_in_stage % stage.seeds
        drawn = stage.population_size - self._opening  # the start itself opens the generation
        z = [self._start_z] * self._opening
        z += [self._possible(np.asarray(row)) for row in self._es.ask(drawn)]
        numbers = range(self._asked, self._asked + len(z))
        self._asked_z = dict(zip(numbers, z, strict=True))
        self._asked += len(z)
        self._drawn = [
            Candidate(n, self._x(z), stage.level, seed, self._number)
            for n, z in self._asked_z.items()
        ]
        self._to_ask = list(self._drawn)

    def _x(self, z: Array) -> Array:
        """The design `z` (d,) in physical units; the start bit for bit as it was given."""
        return self._given.get(z.tobytes(), frozen(self._problem.to_x(z)))

    @property
    def _runs(self) -> list[list[float]]:
        """Values of each candidate of the generation, its own and its replicates'."""
        runs = [[self._told[c.index]] for c in self._drawn]
        for position, candidate in self._again:
            runs[position].append(self._told[candidate.index])
        return runs

    def _repeat(self, positions: Sequence[int]) -> None:
        counts = [len(r) for r in self._runs]
        for position in positions:
            first = self._drawn[position]
            seed = first.seed + counts[position] * self._stage.seeds
            replicate = replace(first, index=self._asked, seed=seed)
            self._again.append((position, replicate))
            self._to_ask.append(replicate)
            counts[position] += 1
            self._asked += 1

    def _update(self, runs: Sequence[Sequence[float]]) -> None:
        if self._again:
            self._noise = self._noise.after(runs)
        else:
            self._noise = self._noise.aged
        settled = self._rule.settled(runs, self._noise)
        means = np.array([np.mean(r) for r in runs])
        f = _finite(np.sort(means)[settled.ranks.astype(int)])
        z = [self._asked_z[c.index] for c in self._drawn]
        tell(self._es, z, list(f))
        self._es.sigma *= settled.sigma_factor
        self._rule = settled.after
        self._note_best(runs)
        candidates, self._drawn, self._again, self._told = self._drawn, [], [], {}
        self._opening, self._why = False, ""
        self._number += 1
        self._generations_in_stage += 1
        self._runs_in_stage += sum(len(r) for r in runs)
        self._move_on(np.array([c.x for c in candidates]))

    def _note_best(self, runs: Sequence[Sequence[float]]) -> None:
        self._positive &= all(f > 0.0 for its in runs for f in its)
        values, deviations = believed_values(runs, self._noise.share)
        self._in_stage += [
            (float(f), c.x) for f, c in zip(values, self._drawn, strict=True) if np.isfinite(f)
        ]
        best = int(np.argmin(values))
        if values[best] < self._best_f:
            self._best_f, self._best_deviation = float(values[best]), float(deviations[best])
            self._best_z, self._best_x = self._asked_z[self._drawn[best].index], self._drawn[best].x
        if self._noise.freedom > 0.0 and self._best_x is not None:
            self._insight = Insight(
                self._number, belief(runs, self._noise.share).certainty,
                sum(len(r) for r in runs), self._stage.level, tuple(map(float, self._best_x)),
                self._best_f, self._best_deviation, positive=self._positive,
            )  # fmt: skip

    def should_stop(self) -> str | None:
        """Why the search is over, in words; None while it goes on."""
        if not self._stage_done:
            return None
        return "the planned generations on every level are done"

    @property
    def _stage_done(self) -> bool:
        """Whether no further generation fits; replicates are part of the plan."""
        return self._runs_left < self._stage.population_size

    @property
    def _runs_left(self) -> int:
        """Runs that the stage has left for generations not finished yet."""
        return self._stage.runs - self._runs_in_stage

    @property
    def _stage(self) -> Stage:
        return self._stages[self._stage_number]

    @property
    def _later_stages(self) -> tuple[Stage, ...]:
        return self._stages[self._stage_number + 1 :]

    def _move_on(self, designs: Array) -> None:
        if self._stage_done:
            if self._later_stages:
                self._stage_number += 1
                self._restarts += 1
                self._begin_stage(self._best_z, why=f"level change to {self._stage.level}")
            return
        exchanged = self._watch.after(designs, self._problem.to_x(self._best_z))
        if exchanged is not None:
            self._restart(self._problem.to_z(exchanged), why=self._watch.name)
        elif reasons := self._es.stop():
            self._restart(self._best_z, why=f"converged: {', '.join(reasons)}")

    def _begin_stage(self, z: Array, *, why: str) -> None:
        self._generations_in_stage, self._runs_in_stage = 0, 0
        self._noise, self._rule = NoiseShare(), _rule(self._stage, len(z))
        self._best_z, self._best_f, self._best_deviation = z, np.inf, 0.0
        self._in_stage = []
        self._watch.new_stage()
        self._start_from(z, why=why)

    def _restart(self, z: Array, *, why: str) -> None:
        self._restarts += 1
        self._start_from(z, why=why)

    def _start_from(self, z: Array, *, why: str) -> None:
        self._why = why
        self._start_z = np.clip(z, 0.0, 1.0)
        self._opening = True
        self._watch.restart()
        self._es = strategy(
            self._start_z, self._stage.sigma, self._stage.population_size, self._rng,
            tolx=TOLERANCE_X, tolfun=TOLERANCE_F, tolfunhist=TOLERANCE_F, tolflatfitness=5,
        )  # fmt: skip

    def _possible(self, z: Array) -> Array:
        """The draw `z` itself if that design can be built, else the first new one that can."""
        redraws = (np.asarray(self._es.ask(1)[0]) for _ in count())
        return self._problem.possible(chain([z], redraws))


def _rule(stage: Stage, dimension: int) -> Reevaluation:
    match stage.reevaluate:
        case "none":
            return NoReplicates()
        case "ranks":
            return UncertaintyHandling(dimension)
        case "elite":
            return EliteDoubt()


def _finite(f: Array) -> Array:
    """Values as CMA-ES takes them: failed runs rank last, and equal among themselves."""
    finite = f[np.isfinite(f)]
    worst = finite.max() if finite.size else 0.0
    return np.where(np.isfinite(f), f, worst + 1.0 + abs(worst))
