"""`mfopt ladder`: the levels of a study and what they cost."""

from rich.table import Table

from mfopt.commands.shared import StudyFile, screen
from mfopt.study.assemble import Assembled, assemble
from mfopt.study.file import Study
from mfopt.study.material import read_with_material


def ladder(study_file: StudyFile) -> None:
    """Show the levels of a study, what they cost and what the study spends on them."""
    study, *_ = read_with_material(study_file)
    parts = assemble(study, where=str(study_file))
    screen.print(ladder_table(study, parts))
    screen.print(spending(study, parts))


def ladder_table(study: Study, parts: Assembled) -> Table:
    """The levels with their engines, what a run costs, and the runs planned."""
    planned = _planned_runs(study, parts)
    work = {level.name: level.work(parts.problem.baseline) for level in parts.all_levels}
    top = work[parts.ladder.top.name]
    columns = ("level", "engine", "grains", "work of a run", "full runs", "runs")
    table = Table(*columns, title=f"{study.study.name}: the ladder")
    described = list(parts.described)
    if parts.reference is not None and parts.reference_level is not None:
        described.append({**described[-1], "engine": parts.reference.engine})
        planned[parts.reference_level.name] = "2"
    for level, said in zip(parts.all_levels, described, strict=True):
        cells = (
            str(said["engine"] or "-"),
            str(said.get("grains", "-")),
            f"{work[level.name]:.3g}",
        )
        table.add_row(level.name, *cells, f"{work[level.name] / top:.3g}", planned[level.name])
    return table


def _planned_runs(study: Study, parts: Assembled) -> dict[str, str]:
    """Runs that a level is planned to have in search and confirmation, in words."""
    stages = study.search.stages(study.problem.objective)
    planned = {}
    for name in parts.ladder.names:
        search = sum(s.runs for s in stages if s.level == name)
        after = study.confirm.runs(starts=parts.starts is not None)
        confirm = after if name == parts.ladder.top.name else 0
        if stages:
            planned[name] = str(search + confirm)
        else:
            planned[name] = f"search + {confirm}" if confirm else "search"
    return planned


def spending(study: Study, parts: Assembled) -> str:
    """What the study may spend in all, in runs of the target level."""
    x, its = parts.problem.baseline, study.search
    full_run = parts.ladder.top.work(x)
    after = float(study.confirm.runs(starts=parts.starts is not None))
    if parts.reference_level is not None:
        after += 2.0 * parts.reference_level.work(x) / full_run
    if its.budget is not None:
        how = "which it spreads over the levels by itself"
        spent = its.budget
    else:
        how = "as planned"
        stages = its.stages(study.problem.objective)
        runs = ((parts.ladder[s.level], s.runs) for s in stages)
        spent = sum(level.work(x) * n for level, n in runs) / full_run
    return _first(parts) + (
        f"The search may spend {spent:.3g} full runs, {how}; finalists, confirmation and reference "
        f"{after:.3g} more. A full run is one run of {parts.ladder.top.name}, the target level."
    )


def _first(parts: Assembled) -> str:
    """What is run before the search, in words; empty without starts."""
    its = parts.starts
    if its is None:
        return ""
    x, level = parts.problem.baseline, parts.ladder[its.level]
    cost = len(its.designs) * its.seeds * level.work(x) / parts.ladder.top.work(x)
    return (
        f"First {len(its.designs)} designs are run at {its.level} with {its.seeds} seeds each, "
        f"{cost:.3g} full runs that a budget includes; the search begins at the best of them. "
    )
