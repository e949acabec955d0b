"""`mfopt check`: what a study or case is about, what it would run, and what that would cost."""

from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import Annotated

import typer
from rich.console import RenderableType
from rich.table import Table

from mfopt.commands.check_case import check_case
from mfopt.commands.ladder import ladder_table, spending
from mfopt.commands.shared import duration, screen
from mfopt.commands.workers import new_runner, prepare_engines, started, workers_of
from mfopt.errors import ConfigError
from mfopt.records.level import Level
from mfopt.study.assemble import Assembled, assemble
from mfopt.study.file import CaseGiven, Study
from mfopt.study.material import read_with_material


def check(
    study_file: Annotated[Path, typer.Argument(help="study file or case file (TOML)")],
    dry_run: Annotated[
        bool,
        typer.Option("--dry-run", help="run every level or recording once, and measure the time"),
    ] = False,
) -> None:
    """Read a study or a case, and say what `mfopt run` or `mfopt calibrate` would do and cost."""
    if not study_file.exists():
        raise ConfigError(
            f"{study_file} does not exist; give a study file (`mfopt init` writes one) or the case "
            "file of a calibration (docs/calibration/recordings.md)"
        )
    try:
        study, _, taken = read_with_material(study_file)
    except CaseGiven:
        check_case(study_file, dry_run=dry_run)
        return
    parts = assemble(study, where=str(study_file))
    for part in described(study, parts):
        screen.print(part)
    for line in taken.words if taken else []:
        screen.print(f"material: {line}")
    if dry_run:
        prepare_engines(study, parts, screen)
        with closing(new_runner(study)) as runner:
            rates = started(study, parts, runner).seconds_per_work
        for part in measured(study, parts, rates):
            screen.print(part)


def described(study: Study, parts: Assembled) -> list[RenderableType]:
    """What a run of the study would do, in an engineer's words."""
    scene = "a problem of your own" if study.problem.scene is None else study.problem.scene
    return [
        f"{study.study.name}: {scene}, {parts.problem.dimension} variables; "
        f"the objective {study.problem.objective} becomes as small as possible",
        _variables(parts),
        ladder_table(study, parts),
        spending(study, parts),
        *_engines(parts),
    ]


def measured(study: Study, parts: Assembled, rates: Mapping[str, float]) -> list[RenderableType]:
    """What the dry run found: how long a run of each level takes, and about how long all takes.

    Args:
        rates: seconds that a unit of work takes, by level.
    """
    x = parts.problem.baseline
    table = Table("level", "time of a run", title="every level runs")
    for level in parts.all_levels:
        table.add_row(level.name, duration(level.work(x) * rates[level.name]))
    workers = workers_of(study)
    total = duration(_cpu_s(study, parts, rates) / workers)
    return [table, f"The study takes about {total} on {workers} workers, as far as that tells."]


def _cpu_s(study: Study, parts: Assembled, rates: Mapping[str, float]) -> float:
    """Time [s] that all runs of the study take one after the other."""

    def time_of(level: Level) -> float:
        return level.work(parts.problem.baseline) * rates[level.name]

    full_run = time_of(parts.ladder.top)
    after = study.confirm.runs(starts=parts.starts is not None) * full_run
    if parts.reference_level is not None:
        after += 2 * time_of(parts.reference_level)
    if study.search.budget is not None:
        return after + study.search.budget * full_run
    stages = study.search.stages(study.problem.objective)
    return after + sum(stage.runs * time_of(parts.ladder[stage.level]) for stage in stages)


def _variables(parts: Assembled) -> Table:
    """The variables with bounds and the design that the search starts from."""
    table = Table("variable", "from", "to", "start", "unit", title="what may be changed")
    for variable, start in zip(parts.problem.variables, parts.problem.baseline, strict=True):
        limits = (f"{variable.lower:g}", f"{variable.upper:g}", f"{start:g}")
        table.add_row(variable.name, *limits, variable.unit)
    return table


def _engines(parts: Assembled) -> list[str]:
    """The engines that were found, and why there is no reference where the study asks for one."""
    versions = dict(parts.versions)
    if (reference := parts.reference) is not None and reference.engine:
        versions[reference.engine] = reference.version
    found = ", ".join(f"{name} {version}" for name, version in versions.items())
    skipped = reference.why_not if reference is not None else None
    return [
        *([f"engines found: {found}"] if found else []),
        *([f"the reference run is skipped: {skipped}"] if skipped else []),
    ]
