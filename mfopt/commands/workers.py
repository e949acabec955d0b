"""Where a study's runs are made, and what is made ready for them."""

import os
from functools import partial

from rich.console import Console

from mfopt.campaign.check import Checked, check_levels, check_stored
from mfopt.campaign.cluster import dask_cluster
from mfopt.campaign.executor import Runner
from mfopt.campaign.local_workers import local_processes
from mfopt.campaign.store import RunDirectory
from mfopt.records.objective import judged
from mfopt.study.assemble import Assembled
from mfopt.study.file import Study


def workers_of(study: Study) -> int:
    """Worker processes of a study: as many as it says, or one a core."""
    return study.run.workers or len(os.sched_getaffinity(0))


def new_runner(study: Study) -> Runner:
    """What makes the runs of a study: processes here, or a cluster."""
    address = study.run.scheduler
    return Runner(dask_cluster(address) if address else local_processes(workers_of(study)))


def prepare_engines(study: Study, parts: Assembled, on: Console) -> None:
    """Compile what all workers here would else compile."""
    if parts.uses_numba and study.run.scheduler is None:
        from fidelity.engines.numba import prepare

        prepare(lambda: on.print("compiling the grain engine, once: about 30 s"))


def started(
    study: Study, parts: Assembled, runner: Runner, run: RunDirectory | None = None
) -> Checked:
    """Start every level of a study once, at the start design, but for what `run` holds.

    Raises:
        SimulationError: if a level cannot run.
    """
    judge = partial(judged, parts.criteria.objective(study.problem.objective))
    ladder, x, reference = parts.ladder, parts.problem.baseline, parts.reference_level
    if run is None:
        return check_levels(ladder, x, runner, judge, reference=reference)
    return check_stored(run, ladder, x, runner, judge, reference=reference)
