"""`mfopt status`: how far a run has come and what it has found."""

import json
from pathlib import Path

import typer
from rich.console import Console

from mfopt.commands.shared import AsJson, RunPath, screen
from mfopt.records.calibration import as_json as calibration_as_json
from mfopt.records.calibration import read_summary
from mfopt.study.stored import holds_calibration, open_stored


def status(path: RunPath, as_json: AsJson = False) -> None:
    """Say how far a run has come and what it has found."""
    if holds_calibration(path):
        found = read_summary(path)
        if as_json:
            typer.echo(calibration_as_json(found))
        else:
            screen.print("\n".join(found.words))
    else:
        print_result(path, screen, as_json=as_json)


def print_result(path: Path, on: Console, *, as_json: bool) -> None:
    """The result in a few lines, or as JSON."""
    from reports.answer import answer, as_text

    run, _ = open_stored(path)
    if as_json:
        typer.echo(json.dumps(answer(run), indent=2))
    else:
        on.print(as_text(run))
