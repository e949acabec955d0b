"""`mfopt geometry`: meshes and CAD files of one design."""

from pathlib import Path
from typing import Annotated

import typer

from geometry.export import write_gltf, write_stl
from mfopt.commands.shared import FromRun, StudyFile, ValuesGiven, chosen_design, screen
from mfopt.errors import ConfigError
from mfopt.files.whole import full_disk_named
from mfopt.study.assemble import assemble
from mfopt.study.material import read_with_material


def geometry(
    study_file: StudyFile,
    directory: Annotated[Path, typer.Option("--directory", "-d", help="where to write")],
    settings: ValuesGiven = None,
    best_of: FromRun = None,
    step: Annotated[bool, typer.Option("--step", help="STEP too (needs the extra cad)")] = False,
) -> None:
    """Write the meshes of one design (STL, glTF, STEP) and say how it can be made."""
    study, *_ = read_with_material(study_file)
    parts = assemble(study, where=str(study_file))
    x = chosen_design(parts.problem, settings or [], best_of)
    if (scene := parts.scene) is None:
        raise ConfigError(f"{study_file} has no geometry: it names no scene in [problem]")
    if (why := parts.problem.impossible(x)) is not None:
        raise ConfigError(f"this design cannot be built: {why}")
    meshes = scene.meshes(x)
    with full_disk_named(directory):
        directory.mkdir(parents=True, exist_ok=True)
        for name, mesh in meshes.items():
            write_stl(directory / f"{name}.stl", mesh)
        write_gltf(directory / "machine.glb", meshes)
        wrote = [f"{', '.join(f'{name}.stl' for name in meshes)} in mm", "machine.glb in m"]
        if step:
            wrote.append(f"{scene.write_step(x, directory)} in mm")
    for sentence in scene.view(x, None).notes:
        screen.print(sentence)
    screen.print(f"wrote to {directory}: {'; '.join(wrote)}")
