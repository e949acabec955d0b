"""`mfopt calibrate`: fit the parameters of a simulation to recordings."""

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from mfopt.campaign.begin import begin, check_disk
from mfopt.campaign.driver import Driver
from mfopt.campaign.driver import Progress as Made
from mfopt.campaign.executor import Runner
from mfopt.campaign.header import header
from mfopt.campaign.local_workers import local_processes
from mfopt.campaign.memory import Memory
from mfopt.campaign.store import writing
from mfopt.commands.shared import AsJson, Into, Quiet, Resume, console
from mfopt.files.whole import full_disk_named, write_aside
from mfopt.records.objective import Criteria
from mfopt.study.stored import CALIBRATE

if TYPE_CHECKING:
    from mfopt.study.case import AssembledCase

RUNS = 200


def calibrate(
    case_file: Annotated[Path, typer.Argument(help="case file (TOML)")],
    directory: Into = None,
    runs: Annotated[int, typer.Option(help="simulations to make in all", min=1)] = RUNS,
    workers: Annotated[
        int | None, typer.Option(help="worker processes; one a core if left out", min=1)
    ] = None,
    resume: Resume = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Fit the parameters of a simulation to recordings, with what the recordings cannot tell."""
    from calibration.campaign import calibrate as fitted_to
    from calibration.campaign import runs_of_each
    from calibration.summary import as_json as told
    from calibration.summary import in_words, summary
    from fidelity.engines.numba import prepare
    from fidelity.rig import SceneRig
    from mfopt.study.case import COMPARED, assemble_case  # half a second, which only this needs

    on = console(quiet=quiet or as_json)
    parts = assemble_case(case_file)
    runs_of_each(parts.case, runs)
    for recording in parts.case.recordings:
        for repeat in recording.repeats:
            for note in repeat.notes:
                on.print(f"{repeat.file}: {note}")
    path = directory or Path("runs") / parts.case.name
    count = workers or len(os.sched_getaffinity(0))
    check_disk(path)
    with full_disk_named(path), writing(path):
        if isinstance(parts.rig, SceneRig):
            prepare(lambda: on.print("compiling the grain engine, once: about 30 s"))
        now = _header(parts, COMPARED, runs, count)
        into = begin(path, parts.text, now, resume=resume, criteria=COMPARED)
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(),
                   TimeRemainingColumn())  # fmt: skip
        runner = Runner(local_processes(count))
        with Progress(*columns, console=on, disable=quiet or as_json) as shown:
            task = shown.add_task("simulations", total=runs)

            def watch(made: Made) -> None:
                shown.advance(task)

            driver = Driver(parts.problem, Memory(into), runner, count, watch, {})
            try:
                campaign = fitted_to(
                    parts.case,
                    parts.noises,
                    lambda candidates: driver.evaluate(candidates, parts.ladder, "none"),
                    runs,
                )
            finally:
                runner.close()
        if into.end is None:
            into.add_end("all planned runs are made")
        result = summary(campaign, parts.case, parts.problem, parts.noises)
        write_aside(path / "calibration.json", told(result).encode())
    if as_json:
        typer.echo(told(result))
    else:
        for line in in_words(result):
            on.print(line)


def _header(
    parts: "AssembledCase", criteria: Criteria, runs: int, workers: int
) -> dict[str, object]:
    return header(
        parts.problem, parts.ladder, name=parts.case.name, seed=parts.case.seed,
        method=CALIBRATE, objective="none", criteria=criteria, workers=workers,
        settings={"runs": runs, **parts.meaning},
    )  # fmt: skip
