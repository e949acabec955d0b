"""Were the right cells flagged? A cell is a channel of a recording over an eighth of its time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.concealed.found import Line
from calibration.diagnosis.where import WINDOWS
from calibration.observed import Observed
from mfopt.arrays import AnyArray, Array

# Root mean squares in standard deviations of the mean of the repeats.
FLAGGED = 1.0  # difference that a diagnosis gives, above which a cell is flagged
TRUE = 1.0  # true difference above which a mismatch is there
DOUBTFUL = (0.5, 1.5)  # true differences that do not count
CLEAR = 5.0  # distance D of the cases that count
MOST = 0.4  # share of true cells of a case that counts: else to flag all of them is right


@dataclass(frozen=True, slots=True)
class Localised:
    """How well cells were flagged, over all cases that count."""

    cases: int
    f1: float
    everything: float  # F1 of flagging every cell


def by_window(observations: Sequence[Observed], rows: Sequence[Array]) -> list[float]:
    """Root mean squares of rows (p,) in the cells, in the order of `calibration.diagnosis.where`.

    Args:
        observations: the recordings.
        rows: of each of them.
    """
    found = []
    for seen, row in zip(observations, rows, strict=True):
        for part in seen.split(row).values():
            edges = np.linspace(0, len(part), min(WINDOWS, len(part)) + 1).round().astype(int)
            windows = np.split(part, edges[1:-1])
            found += [round(float(np.sqrt(np.mean(w**2))), 3) for w in windows]
    return found


def localised(made: Sequence[Line]) -> Localised:
    """The F1 of cases with a clear effect in a part of their cells; nan without any."""
    its = [m for m in made if counts(m)]
    if not its:
        return Localised(0, float("nan"), float("nan"))
    true = np.concatenate([m["true_cells"] for m in its])
    difference = np.array([cell[2] for m in its for cell in m["cells"]])
    sure = (true < DOUBTFUL[0]) | (true > DOUBTFUL[1])
    there, flagged = true[sure] > TRUE, difference[sure] > FLAGGED
    return Localised(len(its), f1(there, flagged), f1(there, np.ones_like(there)))


def counts(its: Line) -> bool:
    """Whether a case has true cells, and not too many."""
    if its["distance"] < CLEAR or not its.get("true_cells"):
        return False
    share = float(np.mean(np.array(its["true_cells"]) > TRUE))
    return 0.0 < share <= MOST


def f1(there: AnyArray, flagged: AnyArray) -> float:
    """Harmonic mean of precision and recall; nan where nothing is there and nothing flagged."""
    hits = int(np.sum(there & flagged))
    total = int(np.sum(there) + np.sum(flagged))
    return 2.0 * hits / total if total else float("nan")
