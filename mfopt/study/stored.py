"""A stored run with what its study says of it."""

from pathlib import Path

from mfopt.campaign.run_header import read_header
from mfopt.campaign.store import RunDirectory, open_run
from mfopt.errors import ConfigError
from mfopt.study.assemble import scene_of
from mfopt.study.file import Study, study_of
from mfopt.study.material import with_material
from mfopt.study.material_file import material_of_tables

CALIBRATE = "calibrate"  # the method of a run directory that holds a calibration
DIAGNOSE = "diagnose"  # that of one which holds a diagnosis, or the library of its rig
RESULTS = {CALIBRATE: "calibration", DIAGNOSE: "diagnosis"}  # what they hold


def kind_of_run(path: Path) -> str:
    """The method of a run directory: of a search, `CALIBRATE` or `DIAGNOSE`.

    Raises:
        ConfigError: if there is no run, or it is of another format.
    """
    return str(read_header(path / "run.json")["method"])


def open_stored(path: Path) -> tuple[RunDirectory, Study | None]:
    """Open a run directory, judged as its study says; no study for a run of `mfopt.minimize`.

    Raises:
        ConfigError: if there is no run, it is of another format or of a calibration, or what is
            there is damaged, or its study is.
    """
    run = open_run(path)
    if (what := RESULTS.get(run.header["method"])) is not None:
        raise ConfigError(
            f"{path} holds a {what}, not a study; its result is in {path}/{what}.json, and mfopt "
            f"status {path} prints it"
        )
    text = run.study()
    if not text:
        return run, None
    study = study_of(text, where=str(run.study_file))
    if (tables := run.header["settings"].get("material")) is not None:
        where = f"{path}: run.json"
        study = with_material(study, material_of_tables(tables, where=where), where=where)
    scene = scene_of(study.problem, str(run.study_file))
    if scene is not None:
        run.criteria = scene.criteria()
    return run, study
