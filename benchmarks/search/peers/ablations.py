"""The assisted search without one of its parts, to see what the part is worth.

They reach into `mfopt.AssistedCmaEs`, which has no options for this: nobody else needs them.
"""

from collections.abc import Mapping

import numpy as np

from benchmarks.search.case import Array
from mfopt.assisted import AssistedCmaEs


class NoProposal(AssistedCmaEs):
    """Without the minimiser of the surrogate's mean beside the samples."""

    def _proposal(self) -> Array:
        return np.asarray(self._samples(1)[0])


class NoPrescreening(AssistedCmaEs):
    """Every candidate is run, however certain the ranking."""

    def _decided(self, weights: Array) -> bool:
        return not self._open


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


ABLATIONS: Mapping[str, type[AssistedCmaEs]] = {
    "mfopt-no-proposal": NoProposal,
    "mfopt-no-prescreening": NoPrescreening,
    "mfopt-no-transfer": NoTransfer,
    "mfopt-planned-levels": PlannedLevels,
}
