"""`mfopt calibrate`: fit the parameters of a simulation to recordings."""

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from calibration.parts import ERRORS, without
from mfopt.arrays import frozen
from mfopt.campaign.begin import begin
from mfopt.campaign.driver import Driver
from mfopt.campaign.executor import Runner
from mfopt.campaign.header import CALIBRATED_WITH, header
from mfopt.campaign.local_workers import local_processes
from mfopt.campaign.memory import Memory
from mfopt.campaign.place import check_disk
from mfopt.campaign.store import RunDirectory, writing
from mfopt.commands.count import counting
from mfopt.commands.report import write_calibration_pages
from mfopt.commands.shared import AsJson, Into, Quiet, Resume, console
from mfopt.errors import ConfigError
from mfopt.files.whole import full_disk_named, write_aside
from mfopt.records import calibration as records
from mfopt.records.evaluation import Candidate, Evaluation
from mfopt.records.level import Ladder
from mfopt.records.objective import Criteria
from mfopt.study.stored import CALIBRATE

if TYPE_CHECKING:
    from mfopt.study.case import AssembledCase

RUNS = 200
MOMENTS = 4  # at which the grains of the best fit are drawn
RESULT = {"posterior": records.FILE, "lbfgsb": records.LEAST_SQUARES}
WRITTEN = (records.FIT_COST, "material.toml", "report.html", "report.pdf")  # beside the result


class Method(StrEnum):
    """How parameters are fitted."""

    POSTERIOR = "posterior"
    LBFGSB = "lbfgsb"


def calibrate(
    case_file: Annotated[Path, typer.Argument(help="case file (TOML)")],
    directory: Into = None,
    runs: Annotated[int, typer.Option(help="simulations to make in all", min=1)] = RUNS,
    workers: Annotated[
        int | None, typer.Option(help="worker processes; one a core if left out", min=1)
    ] = None,
    method: Annotated[
        Method, typer.Option(help="posterior: with intervals; lbfgsb: least squares, to compare")
    ] = Method.POSTERIOR,
    leave_out: Annotated[
        list[str] | None,
        typer.Option(help=f"fit also as if this error did not exist: {', '.join(ERRORS)}"),
    ] = None,
    advise: Annotated[
        bool, typer.Option(help="simulate further experiments and say which would tell most")
    ] = False,
    resume: Resume = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Fit the parameters of a simulation to recordings, with what the recordings cannot tell."""
    from calibration.recordings.notes import notes_by_files
    from fidelity.engines.numba import prepare
    from fidelity.rig import SceneRig
    from mfopt.study.case import assemble_case  # half a second, which only this needs

    on = console(quiet=quiet or as_json)
    parts = assemble_case(case_file)
    ways = Ways(method, runs, tuple(leave_out or ()), advise)
    _refuse(ways, parts)
    for line in (*notes_by_files(parts.case.recordings), *parts.doubts):
        on.print(line)
    path = directory or Path("runs") / parts.case.name
    count = workers or len(os.sched_getaffinity(0))
    check_disk(path)
    with full_disk_named(path), writing(path):
        if isinstance(parts.rig, SceneRig):
            prepare(lambda: on.print("compiling the grain engine, once: about 30 s"))
        into = _begun(path, parts, ways, count, on, resume=resume)
        begun = process_time()
        result, words, found = _fitted(parts, into, ways, count, on, hidden=quiet or as_json)
        fit_cpu_s = process_time() - begun
        if into.end is None:
            into.add_end("all planned runs are made")
        write_aside(path / RESULT[method], result.encode())
        if found is not None:
            words = [*words, f"emulators and posterior: {fit_cpu_s:.0f} s of CPU"]
            write_aside(path / records.FIT_COST, records.fit_cost_as_json(fit_cpu_s).encode())
            _write_material(parts, found, path, on)
            _draw_best_fits(parts, found, path)
            write_calibration_pages(into, on)
    if as_json:
        typer.echo(result)
    for line in words:
        on.print(line)


@dataclass(frozen=True, slots=True)
class Ways:
    """How a calibration is asked for."""

    method: Method
    runs: int
    leave_out: tuple[str, ...]
    advise: bool


def _refuse(ways: Ways, parts: "AssembledCase") -> None:
    """See that options and case go together.

    Raises:
        ConfigError: if they do not.
    """
    from calibration.campaign import runs_of_each

    for error in ways.leave_out:
        without(error)
    if ways.method is Method.POSTERIOR:
        runs_of_each(parts.case, ways.runs)
    elif ways.leave_out:
        raise ConfigError("--leave-out needs the method posterior")
    if ways.advise and (ways.method is not Method.POSTERIOR or not parts.possible):
        raise ConfigError(
            "--advise needs the method posterior, and experiments to choose from: name them in "
            "tables [[possible]] of the case file"
        )


def _begun(
    path: Path, parts: "AssembledCase", ways: Ways, workers: int, on: Console, *, resume: bool
) -> RunDirectory:
    """The run directory, new or gone on with; results of other recordings are deleted."""
    from mfopt.study.case import COMPARED

    meant = {"runs": ways.runs, "method": ways.method.value}
    now = _header(parts, COMPARED, meant, workers)
    into = begin(path, parts.text, now, resume=resume, criteria=COMPARED)
    if into.kept:
        on.print(f"{into.kept} runs made before are used wherever the fit asks for them again")
    if into.end is None:
        for name in (RESULT[ways.method], *WRITTEN):
            (path / name).unlink(missing_ok=True)
    return into


def _fitted(
    parts: "AssembledCase", into: RunDirectory, ways: Ways, workers: int, on: Console,
    *, hidden: bool,
) -> tuple[str, list[str], records.Summary | None]:  # fmt: skip
    """Fit, with a bar that counts the simulations; gives what `_found` gives."""
    from calibration.advice import RUNS as RUNS_OF_ADVICE

    total = ways.runs + (RUNS_OF_ADVICE * len(parts.possible) if ways.advise else 0)
    runner = Runner(local_processes(workers))
    with closing(runner), counting(on, total, hidden=hidden) as count:

        def between() -> None:
            learns = ways.method is Method.POSTERIOR
            if learns and len(parts.case.fitted) < count.made < total:
                count.pause("fitting", "now the fit learns from them")

        driver = Driver(parts.problem, Memory(into), runner, workers, count.one, {})
        return _found(parts, driver, ways, between)


def _found(
    parts: "AssembledCase", driver: Driver, ways: Ways, between: Callable[[], None]
) -> tuple[str, list[str], records.Summary | None]:
    """The result of a fit as JSON and in words, and the summary of a fit with intervals.

    `between` is called after simulations, before the fit goes on.
    """
    from calibration.advice import advise as told_most
    from calibration.campaign import calibrate as fitted_to
    from calibration.least_squares import fit_least_squares, least_squares_summary
    from calibration.left_out import fits_without
    from calibration.summary import summary

    def evaluate(candidates: Sequence[Candidate]) -> list[Evaluation]:
        made = driver.evaluate(candidates, parts.ladder, "none")
        between()
        return made

    def further(candidates: Sequence[Candidate]) -> list[Evaluation]:
        return driver.evaluate(candidates, Ladder(parts.possible), "none")

    if ways.method is Method.LBFGSB:
        found = fit_least_squares(parts.case, parts.noises, evaluate, ways.runs)
        its = least_squares_summary(found, parts.case, parts.rig.channels)
        return its.as_json, its.in_words, None
    campaign = fitted_to(parts.case, parts.noises, evaluate, ways.runs)
    advice: tuple[records.Advice, ...] = ()
    if ways.advise:
        advice, _ = told_most(
            parts.case, [level.name for level in parts.possible], campaign.fitted.posterior,
            parts.noises, further, len(campaign.evaluations),
        )  # fmt: skip
    others = fits_without(campaign, ways.leave_out, parts.case)
    result = summary(
        campaign,
        parts.case,
        parts.problem,
        parts.noises,
        parts.rig.channels,
        advice,
        others,
        parts.doubts,
        possible=bool(parts.possible),
    )
    return records.as_json(result), result.words, result


def _write_material(
    parts: "AssembledCase", found: records.Summary, path: Path, on: Console
) -> None:
    """Write the material file, if what was found is a material."""
    from mfopt.study.calibrated import calibrated_material
    from mfopt.study.material_file import material_text

    material = calibrated_material(found, parts)
    if material is not None:
        write_aside(path / "material.toml", material_text(material).encode())
        on.print(f"wrote {path / 'material.toml'}")


def _draw_best_fits(parts: "AssembledCase", found: records.Summary, path: Path) -> None:
    """Draw the first fitted recording of each scene of mfopt at the best parameters."""
    from fidelity.rig import RigLevel
    from reports.calibration.figures import best_fit_file
    from reports.pictures import snapshots

    best = frozen([p.best for p in found.parameters])
    there: set[str] = set()
    for place, recording in enumerate(parts.case.recordings):
        level = parts.ladder[recording.name]
        if recording.held_out or not isinstance(level, RigLevel) or level.kind in there:
            continue
        there.add(level.kind)
        drawn = snapshots(*level.pictured(best, seed=parts.case.seed, moments=MOMENTS))
        if drawn is not None:
            write_aside(path / best_fit_file(place), drawn.encode())


def _header(
    parts: "AssembledCase", criteria: Criteria, meant: Mapping[str, object], workers: int
) -> dict[str, object]:
    its = header(
        parts.problem, parts.ladder, name=parts.case.name, seed=parts.case.seed,
        method=CALIBRATE, objective="none", criteria=criteria, workers=workers,
        packages=CALIBRATED_WITH, settings={**meant, **parts.meaning},
    )  # fmt: skip
    return its | {"conditions": parts.conditions}
