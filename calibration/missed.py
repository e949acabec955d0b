"""Whether a fit missed parameters that its own runs show to be far better.

An emulator may be sure of itself where no run is, and wrong there. The runs of the posterior show
it. Whether that is the emulator's fault or that of the simulation, other runs tell: some with
nearly the same parameters, one of each recording, may be far nearer to the recordings.
"""

from collections.abc import Sequence

import numpy as np

from calibration.campaign import Campaign
from calibration.posterior import from_unit, to_unit
from calibration.recordings.case import Case
from calibration.runs import finished
from mfopt.arrays import Array
from mfopt.names import with_unit
from mfopt.records.problem import Problem

FAR = 3.0  # times the misfit of other runs, beyond which a fit missed them


def missed(campaign: Campaign, case: Case, problem: Problem) -> list[str]:
    """A sentence that names the better parameters; nothing if the fit has none of them missed."""
    likely, places, rows = campaign.fitted.likelihood, list[Array](), list[Array]()
    for recording, seen in zip(case.fitted, campaign.fitted.observations, strict=True):
        its = finished(campaign.evaluations, recording)
        places.append(to_unit(case.parameters, np.array([e.candidate.x for e in its])))
        rows.append(np.array([seen.row(e.outcome.raw) for e in its]))
    misfits, points = [], []
    for near in _alike(places):
        misfits.append(
            likely.misfit([its[i : i + 1] for its, i in zip(rows, near, strict=True)])[0]
        )
        points.append(np.mean([z[i] for z, i in zip(places, near, strict=True)], axis=0))
    best = int(np.argmin(misfits))
    if campaign.misfit <= FAR * max(misfits[best], len(likely.scores)):
        return []
    values = from_unit(case.parameters, points[best])
    named = ", ".join(
        f"{v.name} = {with_unit(f'{value:.3g}', v.unit)}"
        for v, value in zip(problem.variables, values, strict=True)
    )
    return [
        f"The fit missed better parameters: runs near {named} have a misfit of "
        f"{misfits[best]:.0f} instead of {campaign.misfit:.0f}. Narrow the ranges around these "
        "values and calibrate again"
    ]


def _alike(places: Sequence[Array]) -> list[list[int]]:
    """For each run of the first recording its number, and that of the nearest of each other one."""
    return [
        [number, *(int(np.argmin(np.sum((z - at) ** 2, axis=1))) for z in places[1:])]
        for number, at in enumerate(places[0])
    ]
