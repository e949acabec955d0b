"""Surrogate-assisted CMA-ES over a ladder: it runs only what it cannot predict.

In each generation the surrogate, taught with all runs at all levels around the sampling
distribution, proposes the minimiser of its mean in a trust region beside the CMA-ES samples. The
candidates that are run are that minimiser, then those that joint posterior draws favour (Thompson
sampling), until the ranking of the generation is decided; all of them where runs scatter by more
than half of what candidates differ by. CMA-ES is told the ranking by the weights
that its candidates can expect over joint posterior draws. The level changes by itself
(`mfopt.search.climbing`). The last run is that of the recommended design at the target level, if it
had none there.

Sources: Hansen, arXiv:1604.00772 (CMA-ES); Bajer et al., doi:10.1162/evco_a_00244 (doubly
trained surrogate CMA-ES); Hansen, GECCO 2019, doi:10.1145/3321707.3321842 (lq-CMA-ES: injection
of the model's minimiser); Eriksson et al., arXiv:1910.01739 (trust region, Thompson sampling).
"""

import logging
from collections.abc import Sequence
from itertools import count

import numpy as np

from mfopt.arrays import Array, distinct, frozen
from mfopt.checks import whole
from mfopt.records.evaluation import Candidate, Generation, Insight
from mfopt.records.problem import Problem
from mfopt.search.archive import Archive
from mfopt.search.belief import FEWEST, Belief, learn
from mfopt.search.climbing import Standing, misled, validation_due, why_climb, why_leave
from mfopt.search.distribution import Distribution
from mfopt.search.extra_runs import MOST_OWED, asked, owed, to_repeat, to_validate
from mfopt.search.plan import Plan
from mfopt.search.prescreen import DECIDED, blurred, minimiser, thompson
from mfopt.search.ranking import certainty, expected_weights, recombination_weights
from mfopt.search.recommendation import believed, recommended, scatters
from mfopt.search.search import (
    MOST_SEED,
    MOST_SEEDS,
    POPULATION_SIZES,
    Rung,
    affordable,
    check_rungs,
    check_sigma,
    default_population_size,
    usable,
)
from mfopt.search.surrogate import Surrogate, check_surrogate
from mfopt.search.swap import Exchange, Pair

log = logging.getLogger(__name__)

DRAWS = 128
RADIUS = 2.0  # of the trust region [sqrt(d)], in the distribution's coordinates
WIDTH_AFTER_CLIMB = 0.05  # least widest deviation after a level change, unit cube
FAR = 4.0  # a recommendation so far from the mean [sqrt(d)] starts a new distribution
WIDTH_OF_RESTART = 0.5  # of the first step size
CONVERGED = 1e-6  # widest deviation at the target level that leads to a restart, unit cube


class AssistedCmaEs:
    """Surrogate-assisted CMA-ES on a ladder of levels, of which the last is the target.

    Args:
        problem: what to minimise over.
        rungs: the levels, coarse to fine.
        surrogate: learns from all runs.
        budget: cost that may be spent; of several it takes the next, larger one where one is spent,
            so that a search goes on just as it would have ended.
        seed: of all random draws.
        sigma: first step size in the unit cube.
        population_size: candidates per generation; 4 + 3 ln d if left out.
        objective: name of the objective that the values told belong to.
        seeds: simulation seeds that generations take turns on.
        start: first design (d,), physical units; the baseline if left out.
        first_seed: seed of the first simulation.
        exchange: two variables whose values are exchanged, once a level, where the recommended
            design has the first above the second: a minimum that steps do not lead out of.

    Raises:
        ConfigError: if an argument is wrong, or the budget affords no run at the target.
    """

    def __init__(
        self,
        problem: Problem,
        rungs: Sequence[Rung],
        surrogate: Surrogate,
        *,
        budget: float | Sequence[float],
        seed: int,
        sigma: float = 0.2,
        population_size: int | None = None,
        objective: str = "returned",
        seeds: int = 1,
        start: Array | None = None,
        first_seed: int = 1,
        exchange: Pair | None = None,
    ) -> None:
        check_rungs(rungs)
        budgets = affordable(budget, rungs)
        check_surrogate(surrogate)
        check_sigma(sigma)
        self._size = default_population_size(problem.dimension)
        if population_size is not None:
            self._size = whole("population_size", population_size, *POPULATION_SIZES)
        seeds, seed = whole("seeds", seeds, 1, MOST_SEEDS), whole("seed", seed, 0, MOST_SEED)
        self._exchange = Exchange(problem, exchange)
        self._problem, self._rungs, self._surrogate = problem, tuple(rungs), surrogate
        self._plan = Plan([rung.cost for rung in rungs], budgets[0])
        self._later_budgets = list(budgets[1:])
        self._sigma = sigma
        self._objective, self._seeds, self._first_seed = objective, seeds, first_seed
        self._rng = np.random.default_rng(seed)
        first = problem.baseline if start is None else start
        self._start = problem.start(first)
        self._given = {self._start.tobytes(): frozen(first)}  # designs, by z, in physical units
        self._archive = Archive.empty(problem.dimension)
        self._number, self._restarts, self._why = 1, 0, "start"
        self._level, self._lowest, self._target = 0, 0, len(rungs) - 1
        self._since_validation = (0.0, 0)  # cost and runs at the working level
        self._repeated: set[int] = set()  # levels at which a design was run again
        self._belief: Belief | None = None
        self._insight: Insight | None = None
        self._stop: str | None = None
        self._distribution = Distribution(self._start, sigma, self._size, self._rng)
        self._open_generation()

    @property
    def generation(self) -> Generation:
        """The generation that the next `ask` belongs to."""
        return Generation(
            self._number, self._rungs[self._level].level, self._restarts,
            self._distribution.sigma, self._size, self._objective, self._why,
        )  # fmt: skip

    @property
    def insight(self) -> Insight | None:
        """What the last finished generation taught."""
        return self._insight

    @property
    def work_left(self) -> list[tuple[str, int]]:
        """The budget left, in runs at the target level."""
        if self._stop is not None:
            return []
        target = self._rungs[-1]
        return [(target.level, round((self._plan.budget - self._plan.spent.sum()) / target.cost))]

    def should_stop(self) -> str | None:
        """Why the search is over, in words; None while it goes on."""
        return self._stop

    def recommended(self) -> Array | None:
        """The design (d,) to build, as far as is known; None before a run has finished."""
        z = self._recommended()
        return None if z is None else self._x(z)

    def ask(self, n: int | None = None) -> list[Candidate]:
        """Propose up to `n` runs; fewer, or none, while results must come first.

        Without `n`, those that the search needs before it can go on.
        """
        asked: list[Candidate] = []
        while self._stop is None and (n is None or len(asked) < n):
            if not self._plan and n is not None:
                self._keep_busy()
            if not self._plan:
                break
            asked.append(self._begin_next())
        return asked

    def tell(
        self,
        candidates: Sequence[Candidate],
        values: Sequence[float],
        counts: Array | None = None,
    ) -> None:
        """Learn the values of some candidates, in any order; infinite for a failed run.

        Runs of another purpose than "search", made before it, teach and cost the same; what was
        planned of their designs is dropped.

        Args:
            counts: (n, c) soft-constraint terms contained in the values.
        """
        terms = np.zeros((len(candidates), 0)) if counts is None else counts
        for candidate, value, row in zip(candidates, values, terms, strict=True):
            if candidate.purpose == "search":
                run = self._plan.end(candidate.index)
                z, level = run.z, run.level
            else:
                z, level = self._problem.to_z(candidate.x), self._index(candidate.level)
                self._given[z.tobytes()] = candidate.x
                self._plan.spent[level] += self._rungs[level].cost
                self._plan.drop(z, level)
            self._archive = self._archive.added(z, level, candidate.seed, usable(value), row)
        if self._stop is None and not self._plan.waits:
            self._go_on()

    def finalists(self, n: int) -> list[Array]:
        """Up to `n` different designs (d,) that may be the best, the recommended one first.

        The others are those that the surrogate predicts to be best at the target level, doubt
        counted against them.
        """
        best = self.recommended()
        if best is None or self._belief is None:
            return [] if best is None else [best]
        others = self._belief.ranked(len(self._rungs) - 1)[:n]
        return distinct([best, *(self._x(z) for z in others)])[:n]

    def _index(self, level: str) -> int:
        return [rung.level for rung in self._rungs].index(level)

    def _x(self, z: Array) -> Array:
        """The design `z` (d,) in physical units; one that was given so, bit for bit as it was."""
        return self._given.get(z.tobytes(), frozen(self._problem.to_x(z)))

    def _begin_next(self) -> Candidate:
        number, run = self._plan.begin()
        rung = self._rungs[run.level]
        if run.level == self._level:
            spent, runs = self._since_validation
            self._since_validation = (spent + rung.cost, runs + 1)
        seed = self._first_seed + self._number % self._seeds if run.seed is None else run.seed
        x = self._x(run.z)
        return Candidate(number, x, rung.level, seed, self._number)

    @property
    def _affordable(self) -> bool:
        """Whether the budget allows a run at the working level, and those owed at the end."""
        after, cost = self._plan.left_after(self._level), self._rungs[-1].cost
        return after >= cost * MOST_OWED or after >= cost * owed(
            self._archive, self._plan, self._start, self._recommended(), self._level
        )

    def _asked(self, z: Array, level: int) -> bool:
        return asked(self._archive, self._plan, z, level)

    def _keep_busy(self) -> None:
        """Plan a run that the search does not wait for, rather than leave a worker idle."""
        if not self._affordable:
            return
        if self._belief is not None and self._open:
            self._pick(awaited=False)
        elif self._belief is not None or self._archive.finished >= FEWEST:
            self._go_on()  # the surrogate stands in for what is still out
        else:
            self._plan.add(self._samples(1)[0], self._level, awaited=False)

    def _open_generation(self) -> None:
        """Draw the candidates of a generation and plan the first runs."""
        self._plan.await_no_more()
        if not self._affordable:
            self._finish()
            return
        self._plan_repeat()
        if self._belief is None:
            self._pool = self._samples(self._size)
            self._open: list[int] = []
            known = self._asked(self._start, self._level)
            for z in self._pool if known else [self._start, *self._pool]:
                if self._affordable:
                    self._plan.add(z, self._level)
            return
        self._plan_validation()
        self._plan_exchange()
        self._pool = np.vstack([self._proposal(), self._samples(self._size - 1)])
        self._open = list(range(self._size))
        if self._affordable:  # besides validation and exchange
            self._take(0, awaited=True)

    def _finish(self) -> None:
        """Run the recommended design and the start at the target if they were not, then stop."""
        best, target = self._recommended(), self._target
        self._pool, self._open = np.empty((0, self._problem.dimension)), []
        for z in (self._start,) if best is None else (best, self._start):
            if not self._asked(z, target) and self._plan.left_after(target) >= 0.0:
                self._plan.add(z, target)
        if self._plan:
            return
        if not self._later_budgets:
            self._stop = "the budget is spent"
            return
        self._plan.budget = self._later_budgets.pop(0)
        self._open_generation()

    def _plan_repeat(self) -> None:
        """Once a level, run a design again."""
        if self._level in self._repeated:
            return
        z = to_repeat(self._archive, self._plan, self._level, self._lowest)
        if z is not None:
            self._repeated.add(self._level)
            self._plan.add(z, self._level, seed=self._first_seed + self._seeds)

    def _plan_validation(self) -> None:
        above = self._level + 1
        if above == len(self._rungs):
            return
        if not validation_due(*self._since_validation, self._rungs[above].cost):
            return
        if (best := self._recommended()) is None:
            return
        for z in to_validate(self._archive, self._plan, self._start, best, above):
            self._plan.add(z, above)
            self._since_validation = (0.0, 0)

    def _plan_exchange(self) -> None:
        best = self._recommended()
        if best is None or not self._affordable:
            return
        exchanged = self._exchange.attempt(best)
        if exchanged is not None:
            self._plan.add(exchanged, self._level)

    def _proposal(self) -> Array:
        """Minimiser (d,) of the surrogate's mean in the trust region, or a sample instead."""
        assert self._belief is not None
        radius = RADIUS * np.sqrt(self._problem.dimension)
        u = minimiser(self._belief.posterior, self._level, self._belief.u, radius)
        z = self._distribution.to_z(u[None, :])[0]
        if self._problem.impossible(self._problem.to_x(z)) is not None:
            z = self._samples(1)[0]
        return np.asarray(z)

    def _samples(self, n: int) -> Array:
        """Draw (n, d) possible designs."""
        draws = (self._distribution.sample(1)[0] for _ in count())
        return np.array([self._problem.possible(draws) for _ in range(n)])

    def _take(self, place: int, *, awaited: bool) -> None:
        self._open.remove(place)
        self._plan.add(self._pool[place], self._level, awaited=awaited)

    def _pick(self, *, awaited: bool) -> None:
        """Plan one more run of this generation, if the budget allows."""
        if not (self._open and self._affordable):
            return
        taken = [place for place in range(self._size) if place not in self._open]
        (place,) = thompson(self._draws(self._level, 1), taken, 1)
        self._take(place, awaited=awaited)

    def _draws(self, level: int, n: int) -> Array:
        assert self._belief is not None
        u = self._distribution.to_u(self._pool)
        return self._belief.posterior.sample(u, level, n, self._rng)

    def _weights(self, level: int) -> Array:
        return expected_weights(self._draws(level, DRAWS))

    def _learn(self) -> None:
        self._belief = learn(
            self._archive, self._distribution, self._surrogate, self._belief,
            working=self._level, lowest=self._lowest,
        )  # fmt: skip

    def _go_on(self) -> None:
        """All runs that were waited for are told: run more of the generation, or close it."""
        first = self._belief is None
        self._learn()
        if not len(self._pool):  # that was the last run, with nothing to rank
            number, before = self._number, self._insight
            self._next_generation("")
            if before is not None:
                self._insight = self._look_back(number, before.certainty, 1)
            return
        if self._belief is None:
            self._close_untaught()
            return
        draws = self._draws(self._level, DRAWS)
        weights = expected_weights(draws)
        if not first and not self._decided(draws, weights):
            self._pick(awaited=True)
            if self._plan:
                return
        self._close(weights)

    def _decided(self, draws: Array, weights: Array) -> bool:
        """Whether joint draws (draws, n) rank the generation well enough to run no more of it."""
        assert self._belief is not None
        if certainty(weights) < DECIDED:
            return False
        return not (self._scatters and blurred(self._belief.posterior, self._level, draws))

    @property
    def _scatters(self) -> bool:
        """Whether runs may scatter at the working level, at the target as far as is known below."""
        known = scatters(self._archive, self._level, self._target)
        if known is None and 0 < self._level == self._target:
            known = self._archive.scatter(self._level - 1)
        return known is not False

    def _close_untaught(self) -> None:
        """Too few runs have finished to learn from: rank what there is, failed runs last."""
        told = [(self._archive.z == z).all(axis=1) for z in self._pool]
        values = [self._archive.value[rows].min(initial=np.inf) for rows in told]
        order = np.argsort(np.argsort(values, kind="stable"))
        self._distribution.update(self._pool, -recombination_weights(self._size)[order])
        why = self._leave()
        if self._stop is None:
            self._next_generation(why)

    def _close(self, weights: Array) -> None:
        above, certain = self._level + 1, certainty(weights)
        certain_above = 1.0
        if above < len(self._rungs) and len(self._archive.values_at(above)):
            certain_above = certainty(self._weights(above))
        self._distribution.update(self._pool, -weights, min(1.0, certain / DECIDED) ** 2)
        self._learn()
        runs, number = self._size - len(self._open), self._number
        self._next_generation(self._move(certain, certain_above))
        self._insight = self._look_back(number, certain, runs)

    def _next_generation(self, why: str) -> None:
        self._number += 1
        self._why = why
        self._open_generation()

    def _look_back(self, number: int, certain: float, runs: int) -> Insight | None:
        """What generation `number` taught, of the design that is recommended after it.

        Nothing where the levels below were dropped and too few runs are left to learn from.
        """
        z, level = self._recommended(), self._level_recommended
        if z is None or self._belief is None:
            return None
        mean, deviation = believed(
            self._archive, self._belief, self._distribution, z, level, self._target
        )
        return Insight(
            number, certain, runs, self._rungs[level].level,
            tuple(map(float, self._x(z))), mean, deviation,
            positive=bool((self._archive.value > 0.0).all()),
        )  # fmt: skip

    def _move(self, certain: float, certain_above: float) -> str:
        """Change the level or start anew where it is due; why, in words."""
        exchanged = self._exchange.success(self._archive, self._level)
        if exchanged is not None and self._distance(exchanged) > RADIUS * np.sqrt(len(exchanged)):
            self._restarts += 1
            self._begin_at(exchanged, WIDTH_OF_RESTART * self._sigma)
            return self._exchange.name
        widest = self._distribution.widest
        if self._level == self._target:
            if widest < CONVERGED:
                return self._restart("converged")
            return ""
        share = float(self._plan.spent[: self._target].sum() / self._plan.budget)
        standing = Standing(self._level, self._archive, share, widest, certain, certain_above)
        why = why_climb(standing)
        return "" if why is None else self._climb(why)

    def _leave(self) -> str:
        """Leave a level whose runs fail, for the next one or for good; why, in words."""
        why = why_leave(self._archive, self._level)
        if why is None:
            return ""
        if self._level < self._target:
            return self._climb(why)
        self._stop = f"at level {self._rungs[-1].level!r} {why}"
        return ""

    def _climb(self, why: str) -> str:
        failing = why_leave(self._archive, self._level) is not None
        if failing:
            log.warning("level %r is left: %s", self._rungs[self._level].level, why)
        self._level += 1
        self._restarts += 1
        self._exchange.new_level()
        self._since_validation = (0.0, 0)
        change = f"level change to {self._rungs[self._level].level}"
        if failing or misled(self._archive, self._start, self._level):
            self._lowest = self._level
            self._begin_at(self._start, self._sigma)
            return f"{change}, from the start: {why if failing else 'the levels below mislead'}"
        best = self._recommended()
        if best is not None and self._distance(best) > FAR * np.sqrt(len(best)):
            self._begin_at(best, WIDTH_OF_RESTART * self._sigma)
        else:
            self._distribution.widen(WIDTH_AFTER_CLIMB)
            self._learn()
        return f"{change}: {why}"

    def _restart(self, why: str) -> str:
        self._restarts += 1
        best = self._recommended()
        self._begin_at(self._start if best is None else best, WIDTH_OF_RESTART * self._sigma)
        return why

    def _begin_at(self, z: Array, sigma: float) -> None:
        self._distribution = Distribution(z, sigma, self._size, self._rng)
        self._learn()

    def _distance(self, z: Array) -> float:
        return float(np.linalg.norm(self._distribution.to_u(z[None, :])[0]))

    @property
    def _level_recommended(self) -> int:
        """The level that the recommendation is for: the one worked at, in the end the target."""
        return self._level if self._stop is None else self._target

    def _recommended(self) -> Array | None:
        """Best design (d,), unit cube; in the end one run at the target level, if there is any."""
        return recommended(
            self._archive, self._belief, self._distribution, self._problem,
            level=self._level_recommended, target=self._target, fewest=2 * self._size,
            among_runs=self._stop is not None,
        )  # fmt: skip
