"""`mfopt report`: the HTML and PDF pages of a run directory."""

from collections.abc import Callable
from functools import partial

from rich.console import Console

from mfopt.arrays import Array
from mfopt.campaign.store import RunDirectory, open_run
from mfopt.commands.shared import Quiet, RunPath, console
from mfopt.files.whole import full_disk_named
from mfopt.records.view import DesignView
from mfopt.study.assemble import drawn
from mfopt.study.file import Study
from mfopt.study.stored import CALIBRATE, DIAGNOSE, kind_of_run, open_stored


def report(path: RunPath, quiet: Quiet = False) -> None:
    """Write report.html and report.pdf of a finished, running or broken-off run."""
    on = console(quiet=quiet)
    with full_disk_named(path):
        kind = kind_of_run(path)
        if kind == CALIBRATE:
            write_calibration_pages(open_run(path), on)
        elif kind == DIAGNOSE:
            write_diagnosis_pages(open_run(path), on)
        else:
            write_reports(*open_stored(path), on)


def write_reports(run: RunDirectory, study: Study | None, on: Console) -> None:
    """Write the reports of a run of a study, or of one of `mfopt.minimize`."""
    from reports.write import write_report

    seen = None if study is None else drawn(study, where=str(run.study_file))

    def describe(x: Array) -> DesignView | None:
        if seen is None:
            return None
        scene, dem = seen
        return scene.view(x, dem)

    _write(partial(write_report, describe=describe), run, on)


def write_calibration_pages(run: RunDirectory, on: Console) -> None:
    """Write the reports of a calibration that has ended."""
    from reports.calibration import write_calibration_report

    _write(write_calibration_report, run, on)


def write_diagnosis_pages(run: RunDirectory, on: Console) -> None:
    """Write the reports of a diagnosis that has ended."""
    from reports.diagnosis import write_diagnosis_report

    _write(write_diagnosis_report, run, on)


def _write(report_of: Callable[..., None], run: RunDirectory, on: Console) -> None:
    """Write the pages of a run, and say so."""
    pages = {"html": run.path / "report.html", "pdf": run.path / "report.pdf"}
    report_of(run, **pages)
    for page in pages.values():
        on.print(f"wrote {page}")
