"""`mfopt init`: a study file to start from."""

import inspect
import shutil
from pathlib import Path
from typing import Annotated

import typer

from mfopt.commands.shared import screen
from mfopt.errors import ConfigError
from mfopt.study.assemble import SCENES, scene_class

DEFAULT = "dosing"


def init(
    path: Annotated[Path, typer.Argument(help="file to write")] = Path("study.toml"),
    scene: Annotated[
        str, typer.Option(help=f"kind of machine or test: {', '.join(SCENES)}")
    ] = DEFAULT,
) -> None:
    """Write a commented study file to start from."""
    if path.exists():
        raise ConfigError(f"{path} exists already; give another name")
    try:
        shutil.copyfile(template(scene), path)
    except OSError as error:
        raise ConfigError(f"cannot write {path}: {error.strerror}") from error
    screen.print(f"wrote {path}; run it with: mfopt run {path}")


def template(scene: str) -> Path:
    """The commented study of a scene, which lies beside its code.

    Raises:
        ConfigError: if there is no such scene.
    """
    return Path(inspect.getfile(scene_class(scene))).with_name("template.toml")
