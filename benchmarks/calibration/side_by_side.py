"""Runs of equal parameters under the conditions of all fitted recordings, side by side."""

from collections.abc import Mapping, Sequence

import numpy as np

from calibration.observed import Observed
from calibration.posterior import to_unit
from calibration.recordings.case import Case
from calibration.recordings.records import Noise
from calibration.runs import recording_with_runs, seeing
from mfopt.arrays import Array
from mfopt.records.evaluation import Evaluation


def side_by_side(
    case: Case, noises: Mapping[str, Noise], made: Sequence[Evaluation]
) -> tuple[list[Observed], Array, Array]:
    """The fitted recordings, and the parameters (n, d) and rows (n, p) where all runs finished."""
    seen, rows, see = [], [], seeing(case, noises)
    for recording in case.fitted:
        its, parameters, values = recording_with_runs(recording, made, see)
        seen.append(its)
        rows.append({tuple(x): row for x, row in zip(parameters, values, strict=True)})
    whole = [x for x in rows[0] if all(x in other for other in rows)]
    z = to_unit(case.parameters, np.array(whole))
    return seen, z, np.array([np.concatenate([r[x] for r in rows]) for x in whole])
