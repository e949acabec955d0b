"""The assisted search without one of its parts, or with one more, to see what the part is worth.

They reach into `mfopt.AssistedCmaEs`, which has no options for this: nobody else needs them.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from benchmarks.search.case import Array
from mfopt.search.assisted import DRAWS, AssistedCmaEs
from mfopt.search.climbing import BELOW_SHARE
from mfopt.search.prescreen import DECIDED
from mfopt.search.ranking import certainty


class NoProposal(AssistedCmaEs):
    """Without the minimiser of the surrogate's mean beside the samples."""

    def _proposal(self) -> Array:
        return np.asarray(self._samples(1)[0])


class NoPrescreening(AssistedCmaEs):
    """Every candidate is run, however certain the ranking."""

    def _decided(self, draws: Array, weights: Array) -> bool:
        return not self._open


class PrescreeningUnderNoise(AssistedCmaEs):
    """As few candidates are run as rank the generation, however much runs scatter."""

    @property
    def _scatters(self) -> bool:
        return False


class WholeUnderNoise(AssistedCmaEs):
    """Every candidate is run where runs scatter, however little."""

    def _decided(self, draws: Array, weights: Array) -> bool:
        return not self._scatters and super()._decided(draws, weights)


class NoTransfer(AssistedCmaEs):
    """The surrogate learns from the level that the search works at, not from those below."""

    def _learn(self) -> None:
        self._lowest = self._level
        super()._learn()


class PlannedLevels(AssistedCmaEs):
    """Each level has the same share of the budget; nothing is validated at the next one."""

    def _plan_validation(self) -> None:
        pass

    def _move(self, certain: float, certain_above: float) -> str:
        if self._level == len(self._rungs) - 1:
            return super()._move(certain, certain_above)
        share = self._plan.budget / len(self._rungs)
        return self._climb("its share is spent") if self._plan.spent[self._level] >= share else ""


class MovesDown(AssistedCmaEs):
    """Also back to the level below, where that ranks the candidates alike, so far as is known."""

    ALIKE = 0.9  # cosine of the expected weights at both levels
    REST = 3  # generations at a level before
    MOST = 2  # such moves

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        self._arrived, self.moves_down = 1, 0
        super().__init__(*args, **kwargs)

    def _climb(self, why: str) -> str:
        self._arrived = self._number
        return super()._climb(why)

    def _move(self, certain: float, certain_above: float) -> str:
        why = super()._move(certain, certain_above)
        if why or self._level == self._lowest or certain < DECIDED:
            return why
        if self._number - self._arrived < self.REST or self.moves_down == self.MOST:
            return ""
        if self._plan.spent[:-1].sum() > 0.9 * BELOW_SHARE * self._plan.budget:
            return ""
        here, below = self._weights(self._level), self._weights(self._level - 1)
        alike = here @ below / np.sqrt((here @ here) * (below @ below) + 1e-300)
        if certainty(below) < DECIDED or alike < self.ALIKE:
            return ""
        self._level -= 1
        self._arrived, self.moves_down = self._number, self.moves_down + 1
        self._since_validation = (0.0, 0)
        self._learn()
        return f"level change to {self._rungs[self._level].level}: it ranks alike"


class Finalists(AssistedCmaEs):
    """The last runs at the target tell the best designs apart, by top-two Thompson sampling.

    Source: Russo, Operations Research 68 (2020) 1625, arXiv:1602.08448.
    """

    LAST = 6  # runs
    MOST = 5  # finalists

    def _open_generation(self) -> None:
        target = len(self._rungs) - 1
        generation = 0.5 * self._size * self._rungs[target].cost
        late = self._plan.left_after(target, self.LAST) < generation
        if self._belief is None or self._level < target or not late or not self._affordable:
            super()._open_generation()
            return
        self._plan.await_no_more()
        ran, best = self._archive.designs_at(target), self._recommended()
        known = np.unique(ran if best is None else np.vstack([ran, best]), axis=0)
        u = self._distribution.to_u(known)
        mean, variance = self._belief.posterior.latent(u, target)
        last = np.argsort(mean + np.sqrt(variance))[: self.MOST]  # the first leads
        winners = self._belief.posterior.sample(u[last], target, DRAWS, self._rng).argmin(axis=1)
        others = winners[winners > 0]
        chosen = others[0] if len(others) and self._rng.random() < 0.5 else 0
        self._pool, self._open = self._pool[:0], []
        self._plan.add(known[last[chosen]], target)


ABLATIONS: Mapping[str, type[AssistedCmaEs]] = {
    "mfopt-no-proposal": NoProposal,
    "mfopt-no-prescreening": NoPrescreening,
    "mfopt-prescreening-under-noise": PrescreeningUnderNoise,
    "mfopt-whole-under-noise": WholeUnderNoise,
    "mfopt-no-transfer": NoTransfer,
    "mfopt-planned-levels": PlannedLevels,
    "mfopt-with-moves-down": MovesDown,
    "mfopt-with-finalists": Finalists,
}
