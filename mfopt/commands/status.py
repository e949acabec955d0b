"""`mfopt status`: how far a run has come and what it has found."""

import json
from pathlib import Path

import typer
from rich.console import Console

from mfopt.campaign.store import open_run
from mfopt.commands.shared import AsJson, RunPath, screen
from mfopt.records.calibration import FILE, LEAST_SQUARES, read_summary
from mfopt.records.calibration import as_json as calibration_as_json
from mfopt.study.stored import holds_calibration, open_stored


def status(path: RunPath, as_json: AsJson = False) -> None:
    """Say how far a run has come and what it has found."""
    if holds_calibration(path) and (path / LEAST_SQUARES).exists():
        _print_least_squares(path, as_json=as_json)
    elif holds_calibration(path) and not (path / FILE).exists():
        _print_progress(path, as_json=as_json)
    elif holds_calibration(path):
        found = read_summary(path)
        if as_json:
            typer.echo(calibration_as_json(found))
        else:
            screen.print("\n".join(found.words))
    else:
        print_result(path, screen, as_json=as_json)


def _print_least_squares(path: Path, *, as_json: bool) -> None:
    """The result of a fit by least squares."""
    from calibration.least_squares import read_least_squares  # half a second

    found = read_least_squares(path)
    if as_json:
        typer.echo(found.as_json)
    else:
        screen.print("\n".join(found.in_words))


def _print_progress(path: Path, *, as_json: bool) -> None:
    """How many simulations of a calibration are made."""
    run = open_run(path)
    made, planned = len(run), run.header["settings"]["runs"]
    failed = sum(not evaluation.outcome.finished for evaluation in run.evaluations())
    if as_json:
        typer.echo(json.dumps({"runs": made, "planned": planned, "failed": failed}, indent=2))
    else:
        screen.print(
            f"{made} of {planned} simulations are made, {failed} failed; there is no result yet. "
            "A calibration that was stopped goes on with mfopt calibrate CASE --directory "
            f"{path} --resume"
        )


def print_result(path: Path, on: Console, *, as_json: bool) -> None:
    """The result in a few lines, or as JSON."""
    from reports.answer import answer, as_text

    run, _ = open_stored(path)
    if as_json:
        typer.echo(json.dumps(answer(run), indent=2))
    else:
        on.print(as_text(run))
