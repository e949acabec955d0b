"""A run of an engine in a process of its own."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fidelity.engine import Movement, Setup, checked
from fidelity.engines.exchange import read_movement, write_setup
from fidelity.programs.process import Ended, run_logged
from mfopt.files.scratch import scratch
from mfopt.records.outcome import Status


def move_elsewhere(
    setup: Setup,
    settings: Mapping[str, Any],
    command: Callable[[Path], Sequence[str]],
    died: Callable[[Ended], str],
    *,
    time_limit_s: float,
) -> Movement:
    """Move the grains with a program that reads and writes the files of `exchange`.

    Args:
        setup: what is to be moved.
        settings: what the program needs besides.
        command: the program's command line, for the directory of the files.
        died: how a program ended that left no result, in words.
        time_limit_s: then the program is ended [s].
    """
    with scratch() as directory:
        write_setup(setup, directory, settings)
        ended = run_logged(command(directory), directory=directory, time_limit_s=time_limit_s)
        movement = read_movement(directory, cpu_s=ended.cpu_s)
    if ended.timed_out:
        why = f"not ready within the time limit of {time_limit_s:g} s"
        return failed_movement(setup, "timed_out", why, cpu_s=ended.cpu_s)
    if ended.returncode != 0 or movement is None:
        why = f"{died(ended)}; last lines of its log:\n{ended.last_lines}"
        return failed_movement(setup, "crashed", why, cpu_s=ended.cpu_s)
    return checked(movement)


def failed_movement(setup: Setup, status: Status, why: str, *, cpu_s: float) -> Movement:
    """The movement of a run that ended without a result: the grains are where they began."""
    packing = setup.packing
    n = packing.positions.shape[0]
    return Movement(
        status=status,
        why=why,
        exit_times=np.full(n, np.nan),
        positions=packing.positions,
        orientations=packing.orientations,
        velocities=np.zeros((n, 3)),
        angular_velocities=np.zeros((n, 3)),
        end_time=0.0,
        steps=0,
        sphere_steps=0.0,
        timestep=0.0,
        max_overlap=0.0,
        max_kinetic_energy=0.0,
        cpu_s=cpu_s,
    )
