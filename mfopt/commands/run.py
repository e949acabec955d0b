"""`mfopt run`: search, confirmation and reports of a study."""

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from mfopt.arrays import Array
from mfopt.campaign.begin import begin, begin_reference, budgets
from mfopt.campaign.header import header
from mfopt.campaign.place import check_disk
from mfopt.campaign.store import RunDirectory, writing
from mfopt.commands.report import write_reports
from mfopt.commands.shared import AsJson, Into, Quiet, Resume, StudyFile, console
from mfopt.commands.status import print_result
from mfopt.commands.workers import new_runner, prepare_engines, started, workers_of
from mfopt.errors import SimulationError
from mfopt.files.whole import full_disk_named
from mfopt.search.search import Search, window
from mfopt.study.assemble import Assembled, assemble, level_settings
from mfopt.study.file import Study
from mfopt.study.material import Taken, read_with_material
from mfopt.study.searches import make_search

if TYPE_CHECKING:
    from mfopt.commands.progress import ProgressDisplay


def run(
    study_file: StudyFile,
    directory: Into = None,
    resume: Resume = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Run a study, confirm its best design over fresh seeds and write the reports."""
    from mfopt.campaign.run import run_study

    study, text, taken = read_with_material(study_file)
    parts = assemble(study, where=str(study_file))
    workers = workers_of(study)
    now = _header(study, parts, taken, workers)
    _search(study, parts, budgets(now), parts.problem.baseline)  # refused before all is written
    runner = new_runner(study)
    path = directory or Path("runs") / study.study.name
    on = console(quiet=quiet or as_json)
    for line in taken.words if taken else []:
        on.print(f"material: {line}")
    check_disk(path)
    with full_disk_named(path), writing(path):
        prepare_engines(study, parts, on)
        new = not os.path.lexists(path / "run.json")
        checked = started(study, parts, runner) if new else None  # before anything is written
        into = begin(path, text, now, resume=resume, criteria=parts.criteria)
        _begin_reference(into, parts, on)
        made, ended = into.made, into.end
        if into.kept:
            on.print(
                f"{into.kept} runs made before are used wherever the study asks for them again"
            )
        checked = checked or started(study, parts, runner, into)
        with _display(study, parts, workers, checked.seconds_per_work, on) as display:
            run_study(
                parts.problem,
                parts.ladder,
                partial(_search, study, parts, budgets(into.header)),
                runner,
                into,
                confirm_on=parts.confirm_on,
                confirm_seeds=study.confirm.seeds,
                objective=study.problem.objective,
                checked=checked.evaluations,
                starts=parts.starts,
                finals=study.confirm.finals,
                window=window(into.header["workers"]),
                reference=parts.reference_level,
                watch=display.watch,
            )
        if ended is not None and into.made == made:
            on.print(f"nothing was left to do: {ended}")
        write_reports(into, study, on)
    print_result(path, on, as_json=as_json)
    own, simulators = display.cpu()
    on.print(f"mfopt itself took {own:.1f} s of CPU, {own / (own + simulators):.1%} of all")
    _demand_result(into, parts.ladder.top.name)


def _demand_result(run: RunDirectory, target: str) -> None:
    """Make sure that a run at the target level finished, other than of the baseline.

    Raises:
        SimulationError: if none did; with the commonest reason.
    """
    known = ("check", "confirm baseline", "reference baseline")
    made = [e.outcome for e in run.evaluations() if e.candidate.purpose not in known]
    there = [outcome for outcome in made if outcome.level == target]
    if any(outcome.finished for outcome in there):
        return
    reasons = Counter(outcome.why for outcome in there or made if not outcome.finished)
    often = f", most often so:\n{reasons.most_common(1)[0][0]}" if reasons else ""
    raise SimulationError(
        f"there is no result: none of {len(there)} runs at the target level {target!r} finished; "
        f"{sum(not outcome.finished for outcome in made)} of {len(made)} runs failed{often}"
    )


def _search(study: Study, parts: Assembled, given: Sequence[float], start: Array) -> Search:
    """The search that the study asks for, from a design; `given` are the budgets."""
    its, objective = study.search, study.problem.objective
    return make_search(
        parts.problem,
        parts.ladder,
        stages=its.stages(objective),
        budgets=given,
        seed=study.study.seed,
        sigma=its.sigma,
        population_size=its.population_size,
        seeds=its.seeds,
        objective=objective,
        exchange=its.exchange,
        start=start,
    )


def _begin_reference(run: RunDirectory, parts: Assembled, on: Console) -> None:
    begin_reference(run, parts.reference)
    if run.reference is not None and run.reference.why_not is not None:
        why = f"the reference run is skipped: {run.reference.why_not}"
        on.print(why)


def _display(
    study: Study,
    parts: Assembled,
    workers: int,
    seconds_per_work: Mapping[str, float],
    on: Console,
) -> "ProgressDisplay":
    """The progress, with the work of the confirmation planned."""
    from mfopt.commands.progress import ProgressDisplay

    at_top = parts.ladder.top.name
    work = {level.name: level.work(parts.problem.baseline) for level in parts.all_levels}
    after = study.confirm.runs(starts=parts.starts is not None)
    left = {at_top: after * work[at_top]}
    if parts.reference_level is not None:
        left[parts.reference_level.name] = 2 * work[parts.reference_level.name]
    return ProgressDisplay(
        on,
        work=work,
        full_run=work[at_top],
        unit=parts.problem.objective_unit,
        after=left,
        budget=None if study.search.budget is None else study.search.budget * work[at_top],
        workers=workers,
        seconds_per_work=seconds_per_work,
    )


def _header(study: Study, parts: Assembled, taken: Taken | None, workers: int) -> dict[str, Any]:
    made = header(
        parts.problem,
        parts.ladder,
        name=study.study.name,
        seed=study.study.seed,
        method=study.search.method,
        objective=study.problem.objective,
        criteria=parts.criteria,
        starts=parts.starts,
        workers=workers,
        levels=parts.described,
        versions=parts.versions,
        settings=_settings(study, parts, taken),
    )
    return made if taken is None else {**made, "material": taken.words}


def _settings(study: Study, parts: Assembled, taken: Taken | None) -> dict[str, Any]:
    """All that a study says of what is run, with what it leaves out filled in."""
    its = study.model_dump(mode="json", include={"problem", "level", "search", "confirm"})
    del its["confirm"]["reference"]  # may be there later
    its["level"] = [level_settings(t, "level").model_dump(mode="json") for t in study.level]
    if (scene := parts.scene) is not None:
        wanted = scene.wanted.model_dump(mode="json")
        its["problem"] |= {**wanted, scene.name: scene.settings.model_dump(mode="json")}
    if taken is not None:
        its["material"] = taken.material.model_dump(mode="json")
    return its
