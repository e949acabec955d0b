"""`mfopt init`: a study file to start from."""

import shutil
from pathlib import Path
from typing import Annotated

import typer

from mfopt.commands.shared import screen
from mfopt.errors import ConfigError

TEMPLATE = Path(__file__).with_name("template.toml")  # examples/rice-quick.toml


def init(
    path: Annotated[Path, typer.Argument(help="file to write")] = Path("study.toml"),
) -> None:
    """Write a commented study file to start from."""
    if path.exists():
        raise ConfigError(f"{path} exists already; give another name")
    try:
        shutil.copyfile(TEMPLATE, path)
    except OSError as error:
        raise ConfigError(f"cannot write {path}: {error.strerror}") from error
    screen.print(f"wrote {path}; run it with: mfopt run {path}")
