"""`mfopt check`: what a study is about, what it would run, and what that would cost."""

from rich.console import RenderableType
from rich.table import Table

from fidelity.assemble import Assembled, assemble
from mfopt.commands.ladder import ladder_table, spending
from mfopt.commands.shared import StudyFile, screen
from mfopt.study import Study, read_study


def check(study_file: StudyFile) -> None:
    """Read a study and say what `mfopt run` would do and cost."""
    study, _ = read_study(study_file)
    for part in described(study, assemble(study, where=str(study_file))):
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
    left_out = reference.why_not if reference is not None else None
    return [
        *([f"engines found: {found}"] if found else []),
        *([f"the reference run is left out: {left_out}"] if left_out else []),
    ]
