"""A stored run with what its study says of it."""

from pathlib import Path

from mfopt.campaign.store import RunDirectory, open_run
from mfopt.errors import ConfigError
from mfopt.study.assemble import scene_of
from mfopt.study.file import Study, study_of

CALIBRATE = "calibrate"  # the method of a run directory that holds a calibration


def open_stored(path: Path) -> RunDirectory:
    """Open a run directory, judged as its study says.

    Raises:
        ConfigError: if there is no run, it is of another format or of a calibration, or what is
            there is damaged.
    """
    run = open_run(path)
    if run.header["method"] == CALIBRATE:
        raise ConfigError(
            f"{path} holds a calibration, not a study; its result is in {path}/calibration.json, "
            f"and mfopt calibrate CASE --directory {path} --resume prints it"
        )
    study = study_of_run(run)
    if study is None:
        return run
    scene = scene_of(study.problem, str(run.study_file))
    if scene is not None:
        run.criteria = scene.criteria()
    return run


def study_of_run(run: RunDirectory) -> Study | None:
    """The study of a run; None for one of `mfopt.minimize`.

    Raises:
        ConfigError: if the stored study is damaged.
    """
    text = run.study()
    return study_of(text, where=str(run.study_file)) if text else None
