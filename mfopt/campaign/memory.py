"""What a run directory holds of a run that is replayed."""

import logging
from dataclasses import dataclass

import numpy as np

from mfopt.campaign.store import DamagedArrays, RunDirectory
from mfopt.errors import ConfigError
from mfopt.records.evaluation import Candidate, Evaluation

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class Memory:
    """Evaluations of one run: those on disk are used again, new ones are added to `run`."""

    run: RunDirectory

    def recall(self, candidate: Candidate) -> Evaluation | None:
        """The stored evaluation of a candidate; None if it is to be made.

        One whose arrays are damaged is named in the log, and made again.

        Raises:
            ConfigError: if the directory holds another design under its number.
        """
        try:
            found = self.run.evaluation(candidate.index)
        except DamagedArrays as error:
            log.warning("made again: %s", error)
            self.run.forget(candidate.index)
            return None
        if found is None:
            return self.run.use_again(candidate)
        stored = found.candidate
        same = (stored.level, stored.seed, stored.purpose) == (
            candidate.level, candidate.seed, candidate.purpose,
        )  # fmt: skip
        if not (same and np.array_equal(stored.x, candidate.x)):
            raise ConfigError(
                f"{self.run.path}: evaluation {candidate.index} is of another design than this "
                "search asks for; it was made by another version or another study, so start "
                "a new run directory"
            )
        return found
