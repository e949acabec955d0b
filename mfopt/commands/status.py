"""`mfopt status`: how far a run has come and what it has found."""

import json
from collections.abc import Sequence
from pathlib import Path

import typer
from rich.console import Console

from mfopt.campaign.store import open_run
from mfopt.commands.shared import AsJson, RunPath, screen
from mfopt.records import calibration, diagnosis
from mfopt.study.stored import CALIBRATE, DIAGNOSE, RESULTS, kind_of_run, open_stored


def status(path: RunPath, as_json: AsJson = False) -> None:
    """Say how far a run has come and what it has found."""
    kind = kind_of_run(path)
    if kind == CALIBRATE and (path / calibration.LEAST_SQUARES).exists():
        from calibration.least_squares import read_least_squares  # half a second

        fit = read_least_squares(path)
        _print(fit.in_words, fit.as_json, as_json=as_json)
    elif kind == CALIBRATE and (path / calibration.FILE).exists():
        found = calibration.read_summary(path)
        _print(found.words, calibration.as_json(found), as_json=as_json)
    elif kind == DIAGNOSE and (path / diagnosis.FILE).exists():
        its = diagnosis.read_diagnosis(path)
        _print(its.words, diagnosis.as_json(its), as_json=as_json)
    elif kind in RESULTS:
        _print_progress(path, kind, as_json=as_json)
    else:
        print_result(path, screen, as_json=as_json)


def _print(words: Sequence[str], text: str, *, as_json: bool) -> None:
    if as_json:
        typer.echo(text)
    else:
        screen.print("\n".join(words))


def _print_progress(path: Path, kind: str, *, as_json: bool) -> None:
    """How many simulations of a calibration or diagnosis are made."""
    run = open_run(path)
    made, planned = len(run), run.header["settings"].get("runs")
    failed = sum(not evaluation.outcome.finished for evaluation in run.evaluations())
    if as_json:
        typer.echo(json.dumps({"runs": made, "planned": planned, "failed": failed}, indent=2))
    else:
        of = "" if planned is None else f" of {planned}"
        screen.print(
            f"{made}{of} simulations are made, {failed} failed; there is no result yet. "
            f"A {RESULTS[kind]} that was stopped goes on with mfopt {kind} CASE --directory "
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
