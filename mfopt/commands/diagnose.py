"""`mfopt diagnose`: what is missing where simulation and recordings differ."""

import os
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from mfopt.arrays import frozen
from mfopt.campaign.begin import begin
from mfopt.campaign.driver import Driver
from mfopt.campaign.driver import Progress as Made
from mfopt.campaign.executor import Runner
from mfopt.campaign.header import CALIBRATED_WITH, header
from mfopt.campaign.local_workers import local_processes
from mfopt.campaign.memory import Memory
from mfopt.campaign.place import check_disk
from mfopt.campaign.store import RunDirectory, writing
from mfopt.commands.count import counting
from mfopt.commands.report import write_diagnosis_pages
from mfopt.commands.shared import AsJson, Into, Quiet, Resume, console
from mfopt.errors import ConfigError
from mfopt.files.whole import full_disk_named, write_aside
from mfopt.records import diagnosis as records
from mfopt.records.evaluation import Candidate, Evaluation
from mfopt.records.level import Ladder
from mfopt.study.stored import DIAGNOSE

if TYPE_CHECKING:
    from mfopt.study.case import AssembledCase
    from mfopt.study.material_file import MaterialSettings
    from mfopt.study.rig_library import AssembledLibrary

EACH = 240  # runs of each experiment
MOST = 1000  # of all experiments, unless --runs says otherwise
WRITTEN = ("material.toml", "report.html", "report.pdf")  # beside the result


def diagnose(
    case_file: Annotated[Path, typer.Argument(help="case file (TOML)")],
    directory: Into = None,
    library: Annotated[
        Path | None,
        typer.Option(help="directory of the rig's simulations, which all its cases share"),
    ] = None,
    runs: Annotated[
        int | None, typer.Option(help=f"simulations of the rig; {EACH} an experiment if left out")
    ] = None,
    workers: Annotated[
        int | None, typer.Option(help="worker processes; one a core if left out", min=1)
    ] = None,
    advise: Annotated[
        bool, typer.Option(help="simulate further experiments too, to say which to record next")
    ] = False,
    study: Annotated[
        Path | None,
        typer.Option(help="run directory of a study: run ten of its designs with what was found"),
    ] = None,
    resume: Resume = False,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Say where simulation and recordings differ, and which physics or error was left out."""
    from calibration.recordings.notes import notes_by_files
    from fidelity.engines.numba import prepare
    from fidelity.rig import SceneRig
    from mfopt.study.case import assemble_case  # half a second, which only this needs
    from mfopt.study.material_file import material_text
    from mfopt.study.rig_library import assemble_library, rig_digest

    on = console(quiet=quiet or as_json)
    parts = assemble_case(case_file)
    shared = assemble_library(parts, further=advise)
    each = _runs_of_each(runs, len(shared.conditions))
    for line in (*notes_by_files(parts.case.recordings), *parts.doubts):
        on.print(line)
    path = directory or Path("runs") / f"{parts.case.name}-diagnosis"
    beside = library or Path("runs") / f"library-{rig_digest(shared)}"
    if path.absolute() == beside.absolute():
        raise ConfigError(f"--library and --directory are both {path}; give two directories")
    count = workers or len(os.sched_getaffinity(0))
    for place in (path, beside):
        check_disk(place)
    with full_disk_named(path), writing(path), writing(beside):
        if isinstance(parts.rig, SceneRig):
            prepare(lambda: on.print("compiling the grain engine, once: about 30 s"))
        own, kept = _begun(path, beside, parts, shared, count, resume=resume)
        on.print(f"simulations of this rig are kept in {beside}")
        with closing(Runner(local_processes(count))) as runner:
            with counting(on, each * len(shared.conditions), hidden=quiet or as_json) as made:
                making = _Making(shared, runner, count, made.one)
                planned = shared.library.planned(list(shared.conditions), each)
                learned = making.into(kept)(planned, shared.ladder)
            if kept.end is None:
                kept.add_end("all planned runs are made")
            on.print("comparing what may be missing")
            result = _found(parts, shared, learned, making.into(own))
            material = _material(result, parts, shared)
            if study is not None:
                result = _with_consequence(result, study, material, runner, on)
        if own.end is None:
            own.add_end("all planned runs are made")
        write_aside(path / records.FILE, records.as_json(result).encode())
        if material is not None:
            write_aside(path / "material.toml", material_text(material).encode())
            on.print(f"wrote {path / 'material.toml'}")
        write_diagnosis_pages(own, on)
    if as_json:
        typer.echo(records.as_json(result))
    else:
        on.print("\n".join(result.words))


def _begun(
    path: Path, beside: Path, parts: "AssembledCase", shared: "AssembledLibrary", workers: int,
    *, resume: bool,
) -> tuple[RunDirectory, RunDirectory]:  # fmt: skip
    """The run directories of the case and of the library, new or gone on with."""
    from mfopt.study.case import COMPARED

    own = begin(path, parts.text, _header(parts, shared, workers), resume=resume, criteria=COMPARED)
    kept = begin(
        beside, parts.text, _library_header(shared, beside.name, workers),
        resume=True, criteria=COMPARED,
    )  # fmt: skip
    if own.end is None:  # what is there is of other recordings
        for name in (records.FILE, *WRITTEN):
            (path / name).unlink(missing_ok=True)
    return own, kept


@dataclass(frozen=True, slots=True)
class _Making:
    """Makes runs and stores them in a run directory."""

    shared: "AssembledLibrary"
    runner: Runner
    workers: int
    watch: Callable[[Made], None]

    def into(self, run: RunDirectory) -> Callable[[Sequence[Candidate], Ladder], list[Evaluation]]:
        driver = Driver(self.shared.problem, Memory(run), self.runner, self.workers, self.watch, {})
        return lambda candidates, ladder: driver.evaluate(candidates, ladder, "none")


def _found(
    parts: "AssembledCase",
    shared: "AssembledLibrary",
    learned: Sequence[Evaluation],
    evaluate: Callable[[Sequence[Candidate], Ladder], list[Evaluation]],
) -> records.Diagnosis:
    """The diagnosis, from the runs of the library; further runs confirm it."""
    from calibration.diagnosis.diagnose import diagnose as diagnosed
    from calibration.diagnosis.summary import summary

    confirming: list[Evaluation] = []

    def confirm(candidates: Sequence[Candidate]) -> list[Evaluation]:
        made = evaluate(candidates, shared.confirming)
        confirming.extend(made)
        return made

    channels = parts.rig.channels
    found = diagnosed(
        parts.case, shared.library, shared.experiments, parts.noises, channels, learned, confirm
    )
    return summary(found, parts.case, shared.library, channels, learned, confirming)


def _material(
    found: records.Diagnosis, parts: "AssembledCase", shared: "AssembledLibrary"
) -> "MaterialSettings | None":
    """The corrected grains, if an effect was named that changes some."""
    from mfopt.study.calibrated import material_of

    if found.kind != "named":
        return None
    values = {v.name: v.value for v in found.model}
    x = frozen([values.get(name, its) for name, its in shared.absent.items()])
    not_known = {p.name for p in parts.case.parameters if not p.asked}
    return material_of(
        found.model, {*values} - not_known, x, shared.confirming, parts, True, found.unexplained
    )


def _with_consequence(
    found: records.Diagnosis,
    study: Path,
    material: "MaterialSettings | None",
    runner: Runner,
    on: Console,
) -> records.Diagnosis:
    """The diagnosis with what it changes for a study; as it was if no grains were changed."""
    from calibration.diagnosis.words import in_words
    from mfopt.study.rerun import planned, rerun

    if material is None:
        on.print(f"{study} is not run again: no change of the grains was named")
        return found
    its = planned(study, material)
    made = replace(found, consequence=rerun(its, lambda *given: list(runner.run(*given))))
    return replace(made, words=in_words(made))


def _runs_of_each(runs: int | None, experiments: int) -> int:
    """Simulations of each experiment.

    Raises:
        ConfigError: if they are too few.
    """
    from calibration.diagnosis.diagnose import FEWEST

    each = min(EACH, MOST // experiments) if runs is None else runs // experiments
    if each < FEWEST:
        raise ConfigError(
            f"{runs or MOST} simulations are too few for {experiments} experiments; give at least "
            f"--runs {FEWEST * experiments}"
        )
    return each


def _header(parts: "AssembledCase", shared: "AssembledLibrary", workers: int) -> dict[str, object]:
    """The header of the run directory of the case, whose runs confirm."""
    its = _described(shared, parts.case.name, shared.confirming, parts.case.seed, workers)
    its["settings"] = {**shared.meaning, "fit": parts.meaning["fit"]}
    return its | {"conditions": {r.name: r.conditions for r in parts.case.recordings}}


def _library_header(shared: "AssembledLibrary", name: str, workers: int) -> dict[str, object]:
    """The header of a library, which further experiments do not change."""
    its = _described(shared, name, shared.ladder, shared.library.seed, workers)
    # Which experiments, in which order: with others, runs have other numbers but stay the same.
    its["settings"] = {**shared.meaning, "fit": ", ".join(shared.conditions)}
    return its | {"conditions": shared.conditions, "levels": []}


def _described(
    shared: "AssembledLibrary", name: str, ladder: Ladder, seed: int, workers: int
) -> dict[str, object]:
    from mfopt.study.case import COMPARED

    return header(
        shared.problem, ladder, name=name, seed=seed, method=DIAGNOSE, objective="none",
        criteria=COMPARED, workers=workers, packages=CALIBRATED_WITH, settings=shared.meaning,
    )  # fmt: skip
