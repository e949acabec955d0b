"""What of a case may change between `mfopt calibrate` and `--resume`, and what is run again."""

import json
import shutil
import sys
from collections import Counter
from pathlib import Path

import pytest
from click.testing import Result
from typer.testing import CliRunner

from mfopt.commands.app import app
from mfopt.errors import SimulationError
from mfopt.study.case import assemble_case

BALLS = Path(__file__).resolve().parents[2] / "examples" / "calibration" / "balls"
RUNS = 20
GIVEN = ["--runs", str(RUNS), "--workers", "1", "--method", "lbfgsb"]  # the least work
HELD_OUT = """[[recording]]
name = "tennis ball"
conditions = { diameter = 0.067, mass = 0.058 }
files = ["tennis-1.csv"]
held_out = true
"""
RECORDED, CORRECTED = "1.20,436.1", "1.20,446.1"  # the last sample of a recording


def copied(folder: Path, old: str = "", new: str = "") -> Path:
    """The case in a folder of its own, with one text of its files replaced."""
    folder.mkdir(exist_ok=True)
    texts = {file.name: file.read_text() for file in BALLS.iterdir() if file.is_file()}
    assert any(old in text for text in texts.values())
    for name, text in texts.items():
        (folder / name).write_text(text.replace(old, new, 1) if old else text)
    return folder / "case.toml"


def called(case: Path, run: Path, *options: str) -> Result:
    return CliRunner().invoke(app, ["calibrate", str(case), "-d", str(run), *GIVEN, *options])


def kinds(run: Path) -> Counter[str]:
    lines = (run / "journal.jsonl").read_text().splitlines()
    return Counter(json.loads(line)["kind"] for line in lines)


def result(run: Path) -> dict[str, object]:
    """The result, but for the time that it took."""
    told: dict[str, object] = json.loads((run / "least-squares.json").read_text())
    return {name: value for name, value in told.items() if name != "cpu_s"}


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("balls")
    said = called(copied(folder), folder / "run")
    assert said.exit_code == 0, said.output
    return folder / "run"


def test_a_fit_to_corrected_recordings_is_that_of_a_new_directory(
    done: Path, tmp_path: Path
) -> None:
    case = copied(tmp_path, RECORDED, CORRECTED)
    shutil.copytree(done, tmp_path / "run")
    resumed = called(case, tmp_path / "run", "--resume")
    assert resumed.exit_code == 0, resumed.output
    assert f"{RUNS} runs made before are used wherever the fit asks for them" in resumed.output
    assert called(case, tmp_path / "fresh").exit_code == 0
    assert result(tmp_path / "run") == result(tmp_path / "fresh") != result(done)
    its = kinds(tmp_path / "run")
    assert 2 <= its["again"] < RUNS  # the start and its gradient, whatever was recorded
    assert its["evaluation"] + its["again"] == 2 * RUNS


@pytest.mark.parametrize(
    ("old", "new"),
    [(HELD_OUT, ""), ('name = "table tennis ball"', 'name = "light ball"')],
    ids=["removed", "renamed"],
)
def test_recordings_come_and_go(done: Path, tmp_path: Path, old: str, new: str) -> None:
    case, run = copied(tmp_path, old, new), tmp_path / "run"
    shutil.copytree(done, run)
    resumed = called(case, run, "--resume")
    assert resumed.exit_code == 0, resumed.output
    assert called(case, tmp_path / "fresh").exit_code == 0
    assert result(run) == result(tmp_path / "fresh")
    assert kinds(run)["again"] > 0
    made = kinds(run)["evaluation"]
    assert called(copied(tmp_path), run, "--resume").exit_code == 0
    assert result(run) == result(done)
    assert kinds(run)["evaluation"] == made


def test_an_older_result_is_gone_while_there_is_none_for_the_recordings(
    done: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stopped(*_: object, **__: object) -> None:
        raise SimulationError("stopped")

    case = copied(tmp_path, RECORDED, CORRECTED)
    shutil.copytree(done, tmp_path / "run")
    found = ["least-squares.json", "report.html", "material.toml"]
    for name in found:
        (tmp_path / "run" / name).touch()
    monkeypatch.setattr("mfopt.commands.calibrate._found", stopped)
    assert called(case, tmp_path / "run", "--resume").exit_code == 1
    assert not any((tmp_path / "run" / name).exists() for name in found)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("diameter = 0.040", "diameter = 0.041",
         "conditions table tennis ball diameter 0.04 (now 0.041)"),
        ("range = [0.0, 1.0]", "range = [0.0, 2.0]", "variables drag upper 1.0 (now 2.0)"),
        ("range = [0.0, 1.0]", "range = [0.0, 1.0]\nprior = { normal = [0.4, 0.1] }",
         "settings prior drag nothing (now [0.4, 0.1])"),
        ("seed = 1\n", "seed = 2\n", "seed 1 (now 2)"),
        ("G, AIR = 9.81, 1.2", "G, AIR = 9.81, 1.3", "settings content of balls.py "),
        ("size = 10.0", "size = 9.0", "settings rig channels height size 10.0 (now 9.0)"),
    ],
)  # fmt: skip
def test_what_runs_depend_on_is_named_if_it_changed(
    done: Path, tmp_path: Path, old: str, new: str, said: str
) -> None:
    refused = called(copied(tmp_path, old, new), done, "--resume")
    assert refused.exit_code == 2
    assert said in " ".join(refused.output.split())
    assert "give another directory" in " ".join(refused.output.split())


def test_status_prints_the_result_of_least_squares(done: Path, tmp_path: Path) -> None:
    told, counted = (
        CliRunner().invoke(app, ["status", str(done), *options]) for options in ([], ["--json"])
    )
    text = (done / "least-squares.json").read_text()
    assert json.loads(counted.output) == json.loads(text)
    drag = json.loads(text)["parameters"]["drag"]
    assert told.output.startswith(f"drag = {drag:.3g}\n")
    shutil.copytree(done, tmp_path / "run")
    (tmp_path / "run" / "least-squares.json").write_text(text[:100])
    damaged = CliRunner().invoke(app, ["status", str(tmp_path / "run")])
    assert damaged.exit_code == 2
    assert "cannot read" in damaged.output


@pytest.mark.parametrize("name", ["program.py", "neighbour_of_balls.py"])
def test_a_changed_program_is_named(
    tmp_path: Path, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).write_text("HEIGHT = 10.0\n")
    if name == "program.py":  # a word of a command, named from the folder where mfopt is called
        case = copied(tmp_path / "a", 'function = "balls.py:fall"',
                      f'command = ["{sys.executable}", "{name}"]')  # fmt: skip
    else:
        case = copied(tmp_path, "import math\n", "import math, neighbour_of_balls\n")
    before = assemble_case(case).meaning
    (tmp_path / name).write_text("HEIGHT = 9.0\n")
    now = assemble_case(case).meaning
    assert {key for key in now if now[key] != before[key]} == {f"content of {name}"}


@pytest.mark.parametrize(
    ("old", "new", "alike"),
    [
        ("# Two balls", "# Three balls", True),
        ("time [s],height [cm]\n0.00", "time [s],height [cm]\n0.001", False),
        ("held_out = true", "held_out = false", False),
        ("[[recording]]", "[csv]\nframes_per_s = 50\n[[recording]]", False),
        ("[[recording]]", '[[possible]]\nname = "p"\nconditions = { mass = 1 }\n[[recording]]',
         False),
    ],
)  # fmt: skip
def test_what_only_the_fit_depends_on_is_told_apart(
    tmp_path: Path, old: str, new: str, alike: bool
) -> None:
    before, now = (
        assemble_case(copied(tmp_path / "a")),
        assemble_case(copied(tmp_path / "b", old, new)),
    )
    assert {**now.meaning, "fit": None} == {**before.meaning, "fit": None}
    assert (now.meaning["fit"] == before.meaning["fit"]) is alike


def test_a_case_that_let_all_runs_fail_is_corrected_in_the_same_directory(tmp_path: Path) -> None:
    wrong = copied(tmp_path, '"height": done.y[0]', '"hight": done.y[0]')
    failed = called(wrong, tmp_path / "run")
    assert failed.exit_code == 1
    assert "every run failed" in failed.output
    mended = called(copied(tmp_path), tmp_path / "run")
    assert mended.exit_code == 0, mended.output
    assert json.loads((tmp_path / "run" / "least-squares.json").read_text())["failed"] == 0
