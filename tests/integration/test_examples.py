"""The examples and what the README shows, run as they stand."""

import json
import math
import re
import shutil
import tomllib
from pathlib import Path

import pytest
from campaigns import STUDY
from typer.testing import CliRunner

from mfopt.commands.app import app
from mfopt.search.search import Stage
from mfopt.settings import checked
from mfopt.study.file import Study

ROOT = Path(__file__).parent.parent.parent
README = (ROOT / "README.md").read_text()


@pytest.fixture(autouse=True)
def _at_the_root(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)


def mfopt(*arguments: str | Path) -> str:
    done = CliRunner().invoke(app, list(map(str, arguments)))
    assert done.exit_code == 0, done.output
    return done.stdout


def test_python_of_the_readme(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    printed = 0
    for block in re.findall(r"```python\n(.*?)```", README, re.DOTALL):
        exec(compile(block, "README.md", "exec"), names)
        said = capsys.readouterr().out
        if "print(" in block:
            numbers = [float(n) for n in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", said)]
            assert numbers[:2] == pytest.approx([0.3, -1.0], abs=0.03)
            printed += 1
    assert printed == 2
    assert (tmp_path / "hopper.png").stat().st_size > 10_000


def test_toml_of_the_readme_is_a_valid_level() -> None:
    tables = re.findall(r"```toml\n(.*?)```", README, re.DOTALL)
    assert tables
    for table in tables:
        level = tomllib.loads(table)["level"][0]
        study = {
            "study": {"name": "s"},
            "problem": {"scene": "dosing", "objective": "dispersion"},
            "level": [level],
            "search": {"method": "cma-es", "stage": [{"level": level["name"], "generations": 1}]},
        }
        assert isinstance(checked(Study, study, where="README").search.stages("x")[0], Stage)


def test_own_simulator_from_the_command_line(tmp_path: Path) -> None:
    run = tmp_path / "run"
    answer = json.loads(mfopt("run", "examples/own-simulator.toml", "-d", run, "--json"))
    assert answer["level"] == "fine"
    assert answer["design"]["angle"] == pytest.approx(31.0, abs=3.0)
    assert answer["design"]["width"] == pytest.approx(0.08, abs=0.02)
    assert answer["confirmed_median"] < answer["baseline_median"]
    assert (run / "report.html").stat().st_size > 10_000
    assert (run / "report.pdf").read_bytes().startswith(b"%PDF")


def test_both_ways_to_search_are_valid_studies() -> None:
    planned = re.search(r"search may spend (\S+)", mfopt("ladder", "examples/rice-quick.toml"))
    budget = re.search(r"search may spend (\S+)", mfopt("ladder", "examples/rice-assisted.toml"))
    assert planned
    assert budget
    assert 0.0 < float(planned.group(1)) < float(budget.group(1)) == 48.0


def test_init_writes_a_study_that_is_valid(tmp_path: Path) -> None:
    mfopt("init", tmp_path / "study.toml")
    assert "dem-2000" in mfopt("ladder", tmp_path / "study.toml")


def test_geometry_writes_what_a_workshop_needs(tmp_path: Path) -> None:
    said = mfopt("geometry", "examples/rice-quick.toml", "-d", tmp_path, "--set", "l1=150")
    assert "vertical" in said
    assert "hopper.stl, tube.stl in mm; machine.glb in m" in said
    for name in ("hopper.stl", "cup.stl", "machine.glb"):
        assert (tmp_path / name).stat().st_size > 1000


@pytest.mark.yade
@pytest.mark.skipif(shutil.which("yade") is None, reason="YADE is not installed")
def test_evaluate_traces_a_run_without_changing_it(tmp_path: Path) -> None:
    study = tmp_path / "study.toml"
    study.write_text(STUDY.format(engine='"yade"'))
    plain = json.loads(mfopt("evaluate", study))
    traced = json.loads(mfopt("evaluate", study, "--trace", tmp_path / "trace"))
    assert traced["objective"] == plain["objective"]
    assert len(list((tmp_path / "trace").glob("*.vt*"))) > 10


def test_evaluate_gives_the_quantities_of_an_engineer_with_their_units() -> None:
    answer = json.loads(mfopt("evaluate", "examples/heap.toml"))
    angle = answer["quantities"]["angle of repose [°]"]
    assert angle == pytest.approx(math.degrees(answer["raw"]["angle"]))
