"""Adding a scene: its file, and one line where scenes are listed."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from mfopt.commands.app import app
from mfopt.study import assemble

FIDELITY = Path(__file__).parents[1] / "fidelity"
STUDY = """
[study]
name = "ramp"
[problem]
scene = "ramp"
objective = "lateness"
arrival_ms = 250
[problem.ramp]
slope_deg = 50
[[level]]
name = "ball"
engine = "numba"
grains = 1
spheres_per_grain = 1
[search]
budget = 12
[confirm]
seeds = 1
[run]
workers = 1
"""


def mfopt(*arguments: str | Path) -> str:
    done = CliRunner().invoke(app, list(map(str, arguments)))
    assert done.exit_code == 0, done.output
    return done.stdout


def test_a_new_scene_is_searched_resumed_and_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(FIDELITY)  # for the worker, too
    from toy_scene import Ramp

    monkeypatch.setitem(assemble.SCENES, "ramp", Ramp)  # the one line
    study, run = tmp_path / "ramp.toml", tmp_path / "run"
    study.write_text(STUDY)
    its = json.loads(mfopt("run", study, "-d", run, "--json"))
    arrival = {name: its["needs"]["arrival"][name]["median"] for name in ("best", "baseline")}
    assert abs(arrival["best"] - 0.25) < abs(arrival["baseline"] - 0.25)
    assert its["confirmed_median"] < its["baseline_median"]
    assert "nothing was left to do" in mfopt("run", study, "-d", run, "--resume")
    assert "arrival [ms]" in (run / "report.html").read_text()
    assert "ramp" in mfopt("check", study)
