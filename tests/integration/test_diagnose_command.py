"""`mfopt diagnose` of the example: the effect that its recordings have is named, file to file."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from mfopt.commands.app import app

TANK = Path(__file__).resolve().parents[2] / "examples" / "diagnosis" / "tank"


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The run directory, with the library beside it."""
    folder = tmp_path_factory.mktemp("tank")
    told = CliRunner().invoke(app, ["diagnose", str(TANK / "case.toml"), *options(folder)])
    assert told.exit_code == 0, told.output
    return folder


def options(folder: Path) -> list[str]:
    return ["-d", str(folder / "run"), "--library", str(folder / "library"), "--runs", "240",
            "--workers", "1"]  # fmt: skip


def test_the_effect_is_named_with_its_size(found: Path) -> None:
    its = json.loads((found / "run" / "diagnosis.json").read_text())
    assert (its["kind"], its["effects"]) == ("named", ["slow_valve"])
    (valve,) = (s for s in its["suspects"] if s["name"] == "slow_valve")
    assert valve["interval"][0] < 1.5 < valve["interval"][1]  # [s], as the recordings were made
    assert its["mismatch"] < 0.01
    (held_out,) = its["held_out"]
    assert held_out["after"] < 1.3 < held_out["decoy"] < held_out["before"]


def test_the_pages_say_it(found: Path) -> None:
    page = (found / "run" / "report.html").read_text()
    assert "What is missing: slow_valve" in page
    assert (found / "run" / "report.pdf").stat().st_size > 20_000
    told = CliRunner().invoke(app, ["status", str(found / "run")])
    assert "slow_valve" in told.output


def test_another_case_of_the_rig_uses_the_same_simulations(found: Path, tmp_path: Path) -> None:
    for file in TANK.iterdir():
        if file.is_file():
            (tmp_path / file.name).write_text(file.read_text())
    case = tmp_path / "case.toml"
    case.write_text(case.read_text().replace("held_out = true", "held_out = false"))
    made = len((found / "library" / "journal.jsonl").read_text().splitlines())
    given = [*options(tmp_path), "--library", str(found / "library")]
    told = CliRunner().invoke(app, ["diagnose", str(case), *given, "--json"])
    assert told.exit_code == 0, told.output
    again = len((found / "library" / "journal.jsonl").read_text().splitlines())
    assert again - made < 20  # notes of the new beginning, and no simulation


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("[effects] ", "[others] ", "did you mean"),
        ("null = 0.0, unit = \"s\"", "null = 9.0, unit = \"s\"", "hold null = 9"),
        ("leak = {", "coefficient = {", "is among the parameters too"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_effects_is_named(tmp_path: Path, old: str, new: str, said: str) -> None:
    for file in TANK.iterdir():
        if file.is_file():
            (tmp_path / file.name).write_text(file.read_text().replace(old, new))
    told = CliRunner().invoke(app, ["diagnose", str(tmp_path / "case.toml"), *options(tmp_path)])
    assert told.exit_code == 2
    assert said in " ".join(told.output.split())


def test_too_few_runs_are_refused(tmp_path: Path) -> None:
    given = [*options(tmp_path)[:4], "--runs", "100"]
    told = CliRunner().invoke(app, ["diagnose", str(TANK / "case.toml"), *given])
    assert told.exit_code == 2
    assert "--runs 180" in told.output
