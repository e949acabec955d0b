"""Where a study's runs are made, and what is made ready for them."""

import os

from rich.console import Console

from mfopt.campaign.check import Checked, Recall, check_levels
from mfopt.campaign.cluster import dask_cluster
from mfopt.campaign.executor import Runner
from mfopt.campaign.local_workers import local_processes
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
    study: Study, parts: Assembled, runner: Runner, recall: Recall = lambda candidate: None
) -> Checked:
    """Start every level of a study once, at the start design.

    Raises:
        SimulationError: if a level cannot run.
    """
    objective = parts.criteria.objective(study.problem.objective)
    return check_levels(
        parts.ladder,
        parts.problem.baseline,
        runner,
        lambda outcome: judged(objective, outcome),
        reference=parts.reference_level,
        recall=recall,
    )
