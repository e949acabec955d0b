"""Where a run may be written: never over files of the user's own."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

import mfopt
from mfopt.campaign.place import check_disk
from mfopt.campaign.store import create, writing
from mfopt.commands.app import app
from mfopt.errors import ConfigError

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
BALLS = EXAMPLES / "calibration" / "balls" / "case.toml"
OWN = ("report.html", "report.pdf", "material.toml", "calibration.json", "study.toml")


def contents(folder: Path) -> dict[str, str]:
    return {file.name: file.read_text() for file in folder.iterdir()}


def with_files(folder: Path, *names: str) -> Path:
    for name in names:
        (folder / name).write_text(f"my {name}")
    return folder


@pytest.mark.parametrize(
    "command", [["calibrate", str(BALLS)], ["run", str(EXAMPLES / "hopper.toml")]]
)
@pytest.mark.parametrize("name", OWN)
def test_a_command_keeps_the_files_of_a_folder_of_the_users_own(
    tmp_path: Path, command: list[str], name: str
) -> None:
    mine = contents(with_files(tmp_path, name))
    result = CliRunner().invoke(app, [*command, "-d", str(tmp_path)])
    assert result.exit_code == 2
    assert f"holds {name}, and is no run directory of mfopt" in result.output
    assert "give a new or an empty folder" in result.output
    assert contents(tmp_path) == mine


def test_a_case_folder_is_no_run_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for file in BALLS.parent.iterdir():
        if file.is_file():
            (tmp_path / file.name).write_text(file.read_text())
    monkeypatch.chdir(tmp_path)
    mine = contents(tmp_path)
    result = CliRunner().invoke(app, ["calibrate", "case.toml", "-d", "."])
    assert result.exit_code == 2
    assert "case.toml" in result.output
    assert contents(tmp_path) == mine


def test_minimize_keeps_the_files_of_a_folder_of_the_users_own(tmp_path: Path) -> None:
    mine = contents(with_files(tmp_path, *OWN, "z.csv"))
    levels = {"f": lambda x, seed: float(x[0] ** 2)}
    with pytest.raises(ConfigError, match=r"holds calibration\.json, .* and 1 more, and is no run"):
        mfopt.minimize(levels, {"a": (0.0, 1.0)}, budget=2, directory=tmp_path)
    assert contents(tmp_path) == mine


@pytest.mark.parametrize("left", [0, 1, 2, 3])
def test_a_beginning_that_was_broken_off_is_made_again(tmp_path: Path, left: int) -> None:
    # In the order of their making: the lock, outcomes, study.toml, journal.jsonl; then run.json.
    with writing(tmp_path):
        pass
    if left > 0:
        (tmp_path / "outcomes").mkdir()
    with_files(tmp_path, *("study.toml", ".run.json.12345")[: max(0, left - 1)], ".notes")
    if left > 2:
        (tmp_path / "journal.jsonl").write_text("")
    with writing(tmp_path):
        create(tmp_path, "the study", {})
    assert (tmp_path / "study.toml").read_text() == "the study"


def test_a_lock_alone_gives_no_right_to_other_files(tmp_path: Path) -> None:
    with writing(tmp_path):
        pass
    with_files(tmp_path, "report.html", "study.toml")
    with pytest.raises(ConfigError, match=r"holds report\.html, and is no"), writing(tmp_path):
        pass


def test_a_folder_that_cannot_be_written_is_no_full_disk() -> None:
    check_disk(Path("/proc/none"))
    with pytest.raises(ConfigError, match="cannot write /proc/none"), writing(Path("/proc/none")):
        pass
