"""The command line: the one place where core, levels, geometry and reports meet."""

import json
import math
import os
import shutil
from collections.abc import Callable
from functools import partial, wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from fidelity.assemble import Assembled, assemble, traced
from fidelity.bound import filling_time_bound, smallest_filling_time_bound
from fidelity.dosing import cup_motion, design, design_parts
from fidelity.dosing_level import DosingLevel
from fidelity.dosing_run import dosing_grain
from fidelity.settings import DosingSettings
from geometry.export import write_gltf, write_stl
from geometry.manufacturability import manufacturability
from mfopt.arrays import Array, frozen
from mfopt.begin import begin, begin_reference
from mfopt.errors import ConfigError, MfoptError
from mfopt.executor import Runner, dask_cluster, local_processes
from mfopt.header import header
from mfopt.level import Level
from mfopt.objective import objective_named
from mfopt.problem import Problem
from mfopt.search import Search, rungs, window
from mfopt.store import RunDirectory, full_disk_named, open_run, writing
from mfopt.study import Study, read_study
from reports.design import Describe, DesignView, no_view

if TYPE_CHECKING:
    from mfopt.progress import ProgressDisplay

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    help="Find the best design of a granular machine with few simulation runs.",
)
screen = Console(soft_wrap=True)

StudyFile = Annotated[Path, typer.Argument(help="study file (TOML)")]
RunPath = Annotated[Path, typer.Argument(help="run directory")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="print nothing but errors")]
AsJson = Annotated[bool, typer.Option("--json", help="print the result as JSON")]
Design = Annotated[
    list[str] | None, typer.Option("--set", help="variable=value; what is left out: the baseline")
]
FromRun = Annotated[
    Path | None, typer.Option("--best-of", help="take the best design of this run directory")
]


def _command(function: Callable[..., None]) -> Callable[..., None]:
    """Register a command; exit code 1 if the run failed, 2 if the input is wrong."""

    @wraps(function)
    def wrapped(*args: Any, **kwargs: Any) -> None:
        try:
            function(*args, **kwargs)
        except ConfigError as error:
            _stop(str(error), 2)
        except MfoptError as error:
            _stop(str(error), 1)
        except KeyboardInterrupt:
            _stop("interrupted; the run continues with --resume", 1)

    return app.command()(wrapped)


def _stop(message: str, code: int) -> None:
    typer.echo(f"error: {message}", err=True)
    raise typer.Exit(code)


@_command
def init(
    path: Annotated[Path, typer.Argument(help="file to write")] = Path("study.toml"),
) -> None:
    """Write a commented study file to start from."""
    if path.exists():
        raise ConfigError(f"{path} exists already; give another name")
    example = Path(__file__).parent.parent / "examples" / "rice-quick.toml"
    try:
        shutil.copyfile(example, path)
    except OSError as error:
        raise ConfigError(f"cannot write {path}: {error.strerror}") from error
    screen.print(f"wrote {path}; run it with: mfopt run {path}")


@_command
def run(
    study_file: StudyFile,
    directory: Annotated[
        Path | None, typer.Option("--directory", "-d", help="run directory; runs/NAME if left out")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="go on with a broken-off run, if there is one")
    ] = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Run a study, confirm its best design over fresh seeds and write the reports."""
    from mfopt.run import run_study

    study, text = read_study(study_file)
    parts = assemble(study, where=str(study_file))
    search = _search(study, parts)
    workers = study.run.workers or len(os.sched_getaffinity(0))
    address = study.run.scheduler
    runner = Runner(dask_cluster(address) if address else local_processes(workers))
    path = directory or Path("runs") / study.study.name
    console = Console(quiet=quiet or as_json)
    with full_disk_named(path):
        begin(path, text, _header(study, parts, workers), resume=resume)
        _prepare(study, parts, console)
        with writing(path), _display(study, parts, search, console) as display:
            into = open_run(path)
            _begin_reference(into, parts, console)
            run_study(
                parts.problem,
                parts.ladder,
                search,
                runner,
                into,
                confirm_on=parts.confirm_on,
                confirm_seeds=study.confirm.seeds,
                window=window(into.header["workers"]),
                reference=parts.reference_level,
                watch=display.watch,
            )
        _write_reports(path, parts, console)
    _print_result(path, console, as_json=as_json)
    own, simulators = display.cpu()
    console.print(f"mfopt itself took {own:.1f} s of CPU, {own / (own + simulators):.1%} of all")


def _search(study: Study, parts: Assembled) -> Search:
    """The search that the study asks for; what it needs is only then loaded."""
    its, objective = study.search, study.problem.objective
    if its.method == "cma-es":
        from mfopt.cmaes import CmaEs

        stages = its.stages(objective)
        return CmaEs(parts.problem, stages, seed=study.study.seed, exchange=its.exchange)
    from mfopt.assisted import AssistedCmaEs
    from surrogates.autoregressive import AutoregressiveGp

    assert its.budget is not None  # the study file was refused without
    return AssistedCmaEs(
        parts.problem,
        rungs(parts.ladder, parts.problem.baseline),
        AutoregressiveGp(),
        budget=its.budget,
        seed=study.study.seed,
        sigma=its.sigma,
        population_size=its.population_size,
        objective=objective,
        seeds=its.seeds,
        exchange=its.exchange,
    )


def _prepare(study: Study, parts: Assembled, console: Console) -> None:
    """Compile what all workers here would else compile."""
    if parts.uses_numba and study.run.scheduler is None:
        from fidelity.numba_engine import prepare

        prepare(lambda: console.print("compiling the grain engine, once: about 30 s"))


def _begin_reference(run: RunDirectory, parts: Assembled, console: Console) -> None:
    begin_reference(run, parts.reference)
    if run.reference is not None and run.reference.why_not is not None:
        why = f"the reference run is left out: {run.reference.why_not}"
        console.print(why, highlight=False, soft_wrap=True)


def _display(study: Study, parts: Assembled, search: Search, console: Console) -> "ProgressDisplay":
    """The progress, with the work of the confirmation planned."""
    from mfopt.progress import ProgressDisplay

    at_top = parts.ladder.top.name
    work = {level.name: level.work(parts.problem.baseline) for level in parts.all_levels}
    once_more = 0.0 if parts.reference_level is None else work[parts.reference_level.name]
    return ProgressDisplay(
        console,
        work=work,
        full_run=work[at_top],
        unit=parts.problem.objective_unit,
        confirm_work=2 * (study.confirm.seeds * work[at_top] + once_more),
        budget=None if study.search.budget is None else study.search.budget * work[at_top],
        insight=lambda: search.insight,
    )


def _header(study: Study, parts: Assembled, workers: int) -> dict[str, Any]:
    return header(
        parts.problem,
        parts.ladder,
        name=study.study.name,
        seed=study.study.seed,
        method=study.search.method,
        objective=study.problem.objective,
        workers=workers,
        levels=parts.described,
        versions=parts.versions,
    )


@_command
def status(path: RunPath, as_json: AsJson = False) -> None:
    """Say how far a run has come and what it has found."""
    _print_result(path, screen, as_json=as_json)


@_command
def report(path: RunPath, quiet: Quiet = False) -> None:
    """Write report.html and report.pdf of a finished, running or broken-off run."""
    study_file, parts = open_run(path).study_file, None
    if study_file.stat().st_size:  # a run of `mfopt.minimize` has an empty one
        study, _ = read_study(study_file)
        parts = assemble(study, where=str(study_file))
    with full_disk_named(path):
        _write_reports(path, parts, Console(quiet=quiet))


def _write_reports(path: Path, parts: Assembled | None, console: Console) -> None:
    from reports.write import write_report

    describe: Describe = no_view
    if parts is not None and (dosing := parts.dosing) is not None:
        bound = _finite(smallest_filling_time_bound(dosing))
        describe = partial(_view, dosing, parts.confirm_on.top, bound)
    pages = {"html": path / "report.html", "pdf": path / "report.pdf"}
    write_report(open_run(path), describe=describe, **pages)
    for page in pages.values():
        console.print(f"wrote {page}", highlight=False)


def _view(dosing: DosingSettings, top: Level, bound_any_s: float | None, x: Array) -> DesignView:
    """What a report shows of a design besides its numbers."""
    machine, motion = design(dosing, x), cup_motion(dosing, x)
    grain = dosing_grain(dosing, top.dem) if isinstance(top, DosingLevel) else None
    no_grain = np.empty((0, 3))
    law = machine.motion
    points = {"P1": (law.x1, law.y1), "P2": (law.x2, law.y2)}
    return DesignView(
        label="",
        x=x,
        parts={name: (m.vertices, m.triangles) for name, m in design_parts(dosing, x).items()},
        motion_times=motion.times,
        cup_positions=motion.positions,
        cup_velocities=motion.velocities,
        motion_points={
            name: (t * machine.cycle, machine.stroke * (y - 0.5)) for name, (t, y) in points.items()
        },
        notes=tuple(manufacturability(machine.loft).sentences()),
        bound_s=_finite(filling_time_bound(machine)),
        bound_any_s=bound_any_s,
        grain_offsets=no_grain if grain is None else grain.offsets,
        grain_radii=no_grain[:, 0] if grain is None else grain.radii,
    )


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _print_result(path: Path, console: Console, *, as_json: bool) -> None:
    """The result in a few lines, or as JSON."""
    from reports.answer import answer, as_table

    its = answer(open_run(path))
    if as_json:
        typer.echo(json.dumps(its, indent=2))
    else:
        console.print(as_table(its))


@_command
def evaluate(
    study_file: StudyFile,
    level: Annotated[str | None, typer.Option(help="level; the top one if left out")] = None,
    seed: Annotated[int, typer.Option(help="seed of the simulation", min=0)] = 1,
    settings: Design = None,
    best_of: FromRun = None,
    trace: Annotated[
        Path | None, typer.Option(help="directory for VTK files of the grains (YADE)")
    ] = None,
) -> None:
    """Run one design once on one level and print what came out, as JSON."""
    study, _ = read_study(study_file)
    parts = assemble(study, where=str(study_file))
    x = _design(parts.problem, settings or [], best_of)
    chosen = parts.all_levels[level or parts.ladder.top.name]
    if trace is not None:
        chosen = traced(chosen, trace)
    outcome = chosen.evaluate(x, seed=seed)
    terms = {}
    if outcome.finished:
        terms = objective_named(study.problem.objective)(outcome.raw)
    answer = {
        "design": parts.problem.named(x),
        "level": outcome.level,
        "seed": seed,
        "status": outcome.status,
        "why": outcome.why,
        "terms": terms,
        "objective": sum(terms.values()) if terms else None,
        "raw": {name: float(a) for name, a in outcome.raw.items() if a.ndim == 0},
        "work": outcome.work,
        "cpu_s": outcome.cpu_s,
    }
    typer.echo(json.dumps(answer, indent=2))
    if not outcome.finished:
        raise typer.Exit(1)


@_command
def geometry(
    study_file: StudyFile,
    directory: Annotated[Path, typer.Option("--directory", "-d", help="where to write")],
    settings: Design = None,
    best_of: FromRun = None,
    step: Annotated[bool, typer.Option("--step", help="STEP too (needs the extra cad)")] = False,
) -> None:
    """Write the meshes of one design (STL, glTF, STEP) and say how it can be made."""
    study, _ = read_study(study_file)
    parts = assemble(study, where=str(study_file))
    x = _design(parts.problem, settings or [], best_of)
    if parts.dosing is None:
        raise ConfigError(f'{study_file} has no geometry: it needs scene = "dosing"')
    from geometry.step import write_step

    if (why := parts.problem.impossible(x)) is not None:
        raise ConfigError(f"this design cannot be built: {why}")
    machine, meshes = design(parts.dosing, x), design_parts(parts.dosing, x)
    with full_disk_named(directory):
        directory.mkdir(parents=True, exist_ok=True)
        for name, mesh in meshes.items():
            write_stl(directory / f"{name}.stl", mesh)
        write_gltf(directory / "machine.glb", meshes)
        if step:
            write_step(directory / "hopper.step", machine.loft, machine.tube_end_z)
    for sentence in manufacturability(machine.loft).sentences():
        screen.print(sentence)
    screen.print(f"wrote {', '.join(sorted(p.name for p in directory.iterdir()))} to {directory}")


def _design(problem: Problem, settings: list[str], best_of: Path | None) -> Array:
    """The baseline or a run's best design, with single variables set."""
    x = problem.named(problem.baseline if best_of is None else _best_design(best_of, problem))
    values = dict(x)
    for setting in settings:
        name, _, number = setting.partition("=")
        if name not in values:
            raise ConfigError(f"--set {setting}: the variables are {', '.join(problem.names)}")
        try:
            values[name] = float(number)
        except ValueError as error:
            raise ConfigError(f"--set {setting}: write name=number") from error
        if not math.isfinite(values[name]):
            raise ConfigError(f"--set {setting}: the value must be a finite number")
    return frozen(list(values.values()))


def _best_design(path: Path, problem: Problem) -> Array:
    from reports.answer import found_in

    run = open_run(path)
    _, found = found_in(run)
    if found is None:
        raise ConfigError(f"{path} has no finished run yet")
    names = tuple(variable["name"] for variable in run.header["variables"])
    if names != problem.names:
        raise ConfigError(f"{path} has the variables {', '.join(names)}, the study others")
    return found.x


@_command
def ladder(study_file: StudyFile) -> None:
    """Show the levels of a study, what they cost and what the study spends on them."""
    study, _ = read_study(study_file)
    parts = assemble(study, where=str(study_file))
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
    screen.print(table)
    screen.print(_spending(study, parts, top))


def _planned_runs(study: Study, parts: Assembled) -> dict[str, str]:
    """Runs that a level is planned to have in search and confirmation, in words."""
    stages = study.search.stages(study.problem.objective)
    planned = {}
    for name in parts.ladder.names:
        search = sum(s.runs for s in stages if s.level == name)
        confirm = 2 * study.confirm.seeds if name == parts.ladder.top.name else 0
        if stages:
            planned[name] = str(search + confirm)
        else:
            planned[name] = f"search + {confirm}" if confirm else "search"
    return planned


def _spending(study: Study, parts: Assembled, full_run: float) -> str:
    """What the study may spend in all, in runs of the target level."""
    x, its = parts.problem.baseline, study.search
    after: float = 2.0 * study.confirm.seeds
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
    return (
        f"The search may spend {spent:.3g} full runs, {how}; confirmation and reference "
        f"{after:.3g} more. A full run is one run of {parts.ladder.top.name}, the target level."
    )
