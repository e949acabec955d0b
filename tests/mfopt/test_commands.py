"""What all commands share: exit codes, text on any terminal, what cannot be foreseen."""

import os
import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from mfopt.commands.app import app
from mfopt.commands.shared import exit_codes
from mfopt.errors import ConfigError, SimulationError


def ended(error: Exception) -> tuple[int, str]:
    """Exit code and standard error of a command that raises `error`."""

    def command() -> None:
        raise error

    single = typer.Typer(pretty_exceptions_enable=False)
    single.command()(exit_codes(command))
    done = CliRunner().invoke(single)
    return done.exit_code, done.stderr


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (ConfigError("wrong"), 2),
        (SimulationError("failed"), 1),
        (PermissionError(13, "Permission denied", "/x"), 2),
        (OSError(5, "Input/output error", "/x"), 2),
    ],
)
def test_an_expected_error_is_one_line(error: Exception, code: int) -> None:
    exit_code, said = ended(error)
    assert exit_code == code
    assert re.fullmatch(r"error: .+\n", said)


def test_an_unforeseen_error_says_that_it_is_a_bug_and_keeps_its_traceback() -> None:
    code, said = ended(ZeroDivisionError("division by zero"))
    assert code == 1
    assert said.startswith("Traceback")
    assert re.search(r"\nerror: this is a bug of mfopt \d.*\(ZeroDivisionError\)", said)


def test_version() -> None:
    done = CliRunner().invoke(app, ["--version"])
    assert done.exit_code == 0
    assert re.fullmatch(r"mfopt \d+\.\d+\.\d+\n", done.stdout)


def test_a_message_holds_no_control_characters() -> None:
    _, said = ended(ConfigError("a\x1b[31m\0b"))
    assert "\x1b" not in said
    assert "\0" not in said


def run(code: Sequence[str], **environment: str) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, *code], env={**os.environ, **environment},
        capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip


NAMED = """
[study]
name = "[bold] größe"
[problem]
objective = "returned"
[[problem.variable]]
name = "[/] ü"
lower = 0.0
upper = 1.0
unit = "[/]"
[[level]]
name = "[/] ladder"
engine = "command"
command = ["true"]
[search]
budget = 5
"""


@pytest.mark.parametrize("encoding", ["ascii", "utf-8"])
def test_names_are_text_on_any_terminal(encoding: str, tmp_path: os.PathLike[str]) -> None:
    study = os.path.join(tmp_path, "study.toml")
    with open(study, "w", encoding="utf-8") as file:
        file.write(NAMED)
    done = run(["-m", "mfopt", "ladder", study], PYTHONIOENCODING=encoding)
    assert done.returncode == 0, done.stderr
    assert "[/] ladder" in done.stdout


def test_another_system_is_told_in_one_line() -> None:
    pretend = "import sys; sys.platform = 'win32'; sys.modules['fcntl'] = None; "
    done = run(["-c", pretend + "from mfopt.__main__ import main; main()"])
    assert done.returncode == 2
    assert re.fullmatch(r"error: mfopt runs on Linux only; .*\n", done.stderr)
    done = run(["-c", pretend + "import mfopt; mfopt.minimize"])
    assert done.stderr.splitlines()[-1].startswith("ImportError: mfopt runs on Linux only")


@pytest.mark.parametrize("command", [[], ["run"], ["check"], ["calibrate"], ["report"], ["init"]])
def test_h_is_help(command: list[str]) -> None:
    done = CliRunner().invoke(app, [*command, "-h"])
    assert done.exit_code == 0
    assert "Usage" in done.output


def test_check_of_a_missing_file_names_both_kinds_of_files(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["check", str(tmp_path / "none.toml")])
    assert done.exit_code == 2
    assert "none.toml does not exist; give a study file" in done.output
    assert "case file of a calibration" in done.output
