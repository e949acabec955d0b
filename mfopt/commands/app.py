"""The program `mfopt`: its commands by name."""

from importlib import metadata
from typing import Annotated

import typer

from mfopt.commands.calibrate import calibrate
from mfopt.commands.check import check
from mfopt.commands.diagnose import diagnose
from mfopt.commands.evaluate import evaluate
from mfopt.commands.geometry import geometry
from mfopt.commands.init import init
from mfopt.commands.ladder import ladder
from mfopt.commands.report import report
from mfopt.commands.run import run
from mfopt.commands.shared import exit_codes
from mfopt.commands.status import status

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(asked: bool) -> None:
    if asked:
        typer.echo(f"mfopt {metadata.version('mfopt')}")
        raise typer.Exit


@app.callback()
def main(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="print the version")
    ] = False,
) -> None:
    """Find the best design of a granular machine with few simulation runs."""


for function in (init, check, run, status, report, evaluate, geometry, ladder, calibrate, diagnose):
    app.command()(exit_codes(function))
