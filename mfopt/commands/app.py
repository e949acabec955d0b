"""The program `mfopt`: its commands by name."""

import typer

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
    help="Find the best design of a granular machine with few simulation runs.",
)
for function in (init, run, status, report, evaluate, geometry, ladder):
    app.command()(exit_codes(function))
