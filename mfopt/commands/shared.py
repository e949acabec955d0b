"""What the commands share: the screen, options, exit codes and the choice of a design."""

import errno
import math
import traceback
from collections.abc import Callable
from functools import wraps
from importlib import metadata
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from mfopt.arrays import Array, frozen
from mfopt.errors import ConfigError, MfoptError
from mfopt.names import with_unit
from mfopt.records.outcome import plain
from mfopt.records.problem import Problem
from mfopt.settings import nearest
from mfopt.study.stored import open_stored


def console(*, quiet: bool = False) -> Console:
    """The screen, on which text is text: a name like `[/]` is no markup."""
    return Console(quiet=quiet, soft_wrap=True, markup=False, emoji=False, highlight=False)


screen = console()

StudyFile = Annotated[Path, typer.Argument(help="study file (TOML)")]
RunPath = Annotated[Path, typer.Argument(help="run directory")]
Into = Annotated[
    Path | None,
    typer.Option(
        "--directory",
        "-d",
        help="run directory; below runs/, named after the case or study, if left out",
    ),
]
Resume = Annotated[
    bool, typer.Option("--resume", help="go on with a broken-off run, if there is one")
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="print nothing but errors")]
AsJson = Annotated[bool, typer.Option("--json", help="print the result as JSON")]
ValuesGiven = Annotated[
    list[str] | None, typer.Option("--set", help="variable=value; what is left out: the baseline")
]
FromRun = Annotated[
    Path | None, typer.Option("--best-of", help="take the best design of this run directory")
]


def exit_codes(command: Callable[..., None]) -> Callable[..., None]:
    """Let a command end with 1 if the run failed, 2 if the input is wrong.

    An exception that nobody foresaw is a bug: it says so, keeps its traceback, and ends with 1.
    """

    @wraps(command)
    def wrapped(*args: Any, **kwargs: Any) -> None:
        try:
            command(*args, **kwargs)
        except typer.Exit:
            raise
        except ConfigError as error:
            _stop(str(error), 2)
        except MfoptError as error:
            _stop(str(error), 1)
        except OSError as error:
            if error.errno == errno.EPIPE:  # the reader of the output has gone
                raise
            _stop(_about_file(error), 2)
        except KeyboardInterrupt:
            goes_on = "; the run continues with --resume" if "resume" in kwargs else ""
            _stop(f"interrupted{goes_on}", 1)
        except Exception as error:
            typer.echo(traceback.format_exc(), err=True, nl=False)
            _stop(
                f"this is a bug of mfopt {metadata.version('mfopt')} ({type(error).__name__}); "
                "please report it with the lines above and, if you can, the study file",
                1,
            )

    return wrapped


def _stop(message: str, code: int) -> None:
    typer.echo(f"error: {plain(message)}", err=True)
    raise typer.Exit(code)


def _about_file(error: OSError) -> str:
    """What the system says of a file or directory, in one line."""
    where = f"{error.filename}: " if error.filename is not None else ""
    return f"{where}{error.strerror or error}; check the path, its permissions and its disk"


def duration(seconds: float) -> str:
    """A time in the units that people use."""
    if seconds < 60.0:
        return f"{seconds:.2g} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 90 else f"{seconds / 3600.0:.2g} h"


def chosen_design(problem: Problem, settings: list[str], best_of: Path | None) -> Array:
    """The baseline or a run's best design, with single variables set."""
    x = problem.named(problem.baseline if best_of is None else _best_design(best_of, problem))
    values = dict(x)
    for setting in settings:
        name, _, number = setting.rpartition("=")  # a name may hold one
        if name not in values:
            raise ConfigError(
                f"--set {setting}: write name=number, where name is a variable"
                f"{nearest(name, problem.names)}"
            )
        try:
            values[name] = float(number)
        except ValueError as error:
            raise ConfigError(f"--set {setting}: write name=number") from error
        if not math.isfinite(values[name]):
            raise ConfigError(f"--set {setting}: the value must be a finite number")
    for variable in problem.variables:
        if not variable.lower <= values[variable.name] <= variable.upper:
            raise ConfigError(
                f"{variable.name} = {values[variable.name]:g} must be from {variable.lower:g} to "
                f"{with_unit(variable.upper, variable.unit)}; stay within the study's bounds or "
                "widen them"
            )
    return frozen(list(values.values()))


def _best_design(path: Path, problem: Problem) -> Array:
    from reports.answer import found_in

    run, _ = open_stored(path)
    _, found = found_in(run)
    if found is None:
        raise ConfigError(f"{path} has no finished run yet")
    names = tuple(variable["name"] for variable in run.header["variables"])
    if names != problem.names:
        raise ConfigError(f"{path} has the variables {', '.join(names)}, the study others")
    return found.x
